//! What the hour changes: nothing but the rounding of keys.
//!
//! A session knows the time by the indices of its tokens, frames and samples. Those of tokens enter
//! the networks as rotary phases, and attention sees their differences alone. Two things can be
//! held against that.
//!
//! - *To the bit.* All phases come again after [`PERIOD`] tokens. So a session that starts that
//!   many blocks later must show the same motion, bit for bit, over as many blocks as one likes:
//!   time stamps, noise counters, resamplers, re-anchoring and the integration of the root are part
//!   of it.
//! - *Within a period* a key is turned by its own angle and then rounded to f16, so that motion at
//!   hour 24 cannot have the bits of hour 0, nor can motion that starts one token later. Generated
//!   motion feeds on itself and amplifies the last bit without end (as Lorenz 1963), so
//!   free-running sessions cannot be compared. One block on the same history can: what it changes
//!   by in the two hours after a day must be no more than what it changes by in the first two. Both
//!   are taken over a whole turn of the slowest phase: a few tokens hardly turn the slow ones, so
//!   that their keys keep their rounding, and neighbouring places share theirs. The largest of the
//!   distances is told, not judged: it is where the model is most sensitive to its keys, and as
//!   large in the first hours.

use super::Voices;
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;
use visavis::internals::config::ACTIVITY;
use visavis::internals::frame::BLOCK_SAMPLES;
use visavis::internals::nn::PERIOD;
use visavis::internals::session::{Anchoring, Diagnostics};
use visavis::{BLOCK_FRAMES, Engine, FPS, Frame, Result, Sampler, Session, SessionOptions};

/// Blocks of 24 hours.
const DAY: u64 = 24 * 3600 * FPS as u64 / BLOCK_FRAMES as u64;
/// Blocks that are compared to the bit; re-anchored every eight.
const BLOCKS: usize = 40;
/// Places within the first two hours, and after the day, that single blocks are made at, and the
/// blocks between them: together 48,352 tokens, in which the slowest phase of a head of 64 channels
/// turns once (47,117 tokens). A prime, so that no phase turns evenly.
const PLACES: u64 = 32;
const APART: u64 = 1511;
/// Noises of such a block.
const NOISES: u64 = 8;

/// Differences of motion with the same noise and inputs at other hours.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Hours {
    /// Blocks after which all phases come again.
    pub period_blocks: u64,
    /// Frames in which a session that starts a period later differs in any bit.
    pub period_frames_that_differ: usize,
    /// Distance between joints of one block at the session's start and within the two hours after
    /// it: root mean square and largest, metres.
    pub hours_later: [f64; 2],
    /// The same within the two hours after a day.
    pub day_later: [f64; 2],
}

impl Hours {
    /// Compares.
    ///
    /// # Errors
    /// Those of a session.
    pub(super) fn measure(engine: &Arc<Engine>, voices: &Voices, sampler: Sampler) -> Result<Self> {
        let (now, later) = (talk(engine, voices, sampler, 0)?, talk(engine, voices, sampler, PERIOD)?);
        let same = |(a, b): (&Frame, &Frame)| {
            let shifted = b.index == a.index + PERIOD * BLOCK_FRAMES as u64;
            let stamped = (b.time - b.index as f64 / f64::from(FPS)).abs() < 1e-6;
            shifted && stamped && *a == Frame { index: a.index, time: a.time, ..b.clone() }
        };
        let period_frames_that_differ = now.len() - now.iter().zip(&later).filter(|pair| same(*pair)).count();

        let first = single_blocks(engine, voices, sampler, 0)?;
        let from = |start: u64| -> Result<[f64; 2]> {
            let (mut square, mut most, mut count) = (0.0, 0.0, 0);
            for place in 1..=PLACES {
                let other = single_blocks(engine, voices, sampler, start + APART * place)?;
                let joints = first.iter().zip(&other).flat_map(|(a, b)| a.global.iter().zip(&b.global));
                for (a, b) in joints {
                    let apart = f64::from(a.position.distance(b.position));
                    (square, most, count) = (square + apart * apart, apart.max(most), count + 1);
                }
            }
            Ok([libm::sqrt(square / f64::from(count)), most])
        };
        let (hours_later, day_later) = (from(0)?, from(DAY)?);
        Ok(Self { period_blocks: PERIOD, period_frames_that_differ, hours_later, day_later })
    }
}

/// Gives the session noise that does not know the hour.
fn quieten(session: &mut Session, blocks: usize, seed: u64) -> Result<()> {
    let engine = session.engine();
    if engine.needs_sarah().is_err() {
        // There is no noise.
        return Ok(());
    }
    let latent = engine.config().vae.latent;
    let mut noise = vec![0.0; (engine.idle_blocks() + blocks) * latent];
    for (token, eps) in noise.chunks_exact_mut(latent).enumerate() {
        visavis::internals::flow::normal(seed, token as u64, eps);
    }
    session.reset_with_noise(noise)
}

/// A session from `first_block` on in which nothing is drawn by the hour: free gaze and the activity
/// of a body at rest would be.
fn options(sampler: Sampler, first_block: u64, anchoring: Anchoring) -> SessionOptions {
    let diagnostics = Diagnostics { first_block, anchoring, activity: Some([0.0; ACTIVITY]), ..Default::default() };
    SessionOptions { sampler, gaze: Some(0.8), diagnostics, ..Default::default() }
}

/// The beginning of a voice.
fn beginning(voice: &[f32], samples: usize) -> &[f32] {
    &voice[..samples.min(voice.len())]
}

/// Motion from `first_block` on, of a conversation with a user who walks.
fn talk(engine: &Arc<Engine>, voices: &Voices, sampler: Sampler, first_block: u64) -> Result<Vec<Frame>> {
    let mut session = engine.session(options(sampler, first_block, Anchoring::Every(8)))?;
    quieten(&mut session, BLOCKS, 7)?;
    session.push_agent_audio(beginning(voices.agent(), BLOCKS * BLOCK_SAMPLES), 24_000)?;
    session.push_user_audio(beginning(voices.user(), 2 * BLOCKS * BLOCK_SAMPLES), 48_000)?;
    // Where the user is at frame times; between them the hour's f64 would round another way.
    let before = first_block * BLOCK_FRAMES as u64;
    for frame in 0..(BLOCKS * BLOCK_FRAMES) as u64 {
        let angle = 0.02 * frame as f64;
        let head = Vec3::new(1.5 * libm::sin(angle) as f32, 1.65, 1.5 * libm::cos(angle) as f32);
        session.push_user_head(head, (before + frame) as f64 / f64::from(FPS))?;
    }
    let mut frames = Vec::with_capacity(BLOCKS * BLOCK_FRAMES);
    for _ in 0..BLOCKS {
        frames.extend_from_slice(session.poll(session.next_due())?.unwrap_or_default());
    }
    Ok(frames)
}

/// The first block at `first_block` under several noises: its history is the bundle's idle clip,
/// whenever it is.
fn single_blocks(engine: &Arc<Engine>, voices: &Voices, sampler: Sampler, first_block: u64) -> Result<Vec<Frame>> {
    let mut session = engine.session(options(sampler, first_block, Anchoring::Bundle))?;
    let mut frames = Vec::new();
    for seed in 0..NOISES {
        quieten(&mut session, 1, seed)?;
        session.push_agent_audio(beginning(voices.agent(), BLOCK_SAMPLES), 24_000)?;
        frames.extend_from_slice(session.poll(session.next_due())?.unwrap_or_default());
    }
    Ok(frames)
}
