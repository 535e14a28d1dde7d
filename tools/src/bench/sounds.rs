//! What sounds in the room cost: blocks of a session that hears some and of one that hears none, in
//! turns.

use super::load::Times;
use super::{BenchOptions, Talks, WARM_UP};
use crate::contents::made_with;
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use visavis::internals::frame::BLOCK_SAMPLES;
use visavis::{Engine, Error, ErrorKind, Result, SAMPLE_RATE, Sampler};

/// Blocks of a turn.
const TURN: usize = 10;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct SoundOptions {
    /// Sampler.
    pub sampler: Sampler,
    /// Threads that compute.
    pub threads: usize,
    /// Sources that sound all the time; of 0, nothing is pushed.
    pub sources: u32,
    /// Whether two microphones hear something as well.
    pub ears: bool,
    /// Blocks that are timed with and without.
    pub blocks: usize,
}

/// What was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WithSounds {
    /// Sampler.
    pub sampler: String,
    /// Threads.
    pub threads: usize,
    /// Sources.
    pub sources: u32,
    /// Whether there were ears.
    pub ears: bool,
    /// Blocks with and without.
    pub blocks: usize,
    /// Times of a block without sounds and with them.
    pub block_ms: [Times; 2],
}

impl WithSounds {
    /// Measures `engine`: two sessions in the same conversation, both voices heard, in turns of ten
    /// blocks.
    ///
    /// # Errors
    /// Those of making a session; [`ErrorKind::Argument`] for no blocks, or a bundle without
    /// hearing.
    pub fn run(engine: &Arc<Engine>, options: SoundOptions) -> Result<Self> {
        let SoundOptions { sampler, threads, sources, ears, blocks } = options;
        if blocks == 0 {
            return Err(Error::new(ErrorKind::Argument, "nothing to measure: at least one block"));
        }
        let alone = BenchOptions { sampler, threads, ..BenchOptions::default() };
        let mut talks = [(); 2].map(|()| Talks::new(engine, &alone));
        let mut times = [Vec::with_capacity(blocks), Vec::with_capacity(blocks)];
        let mut turn = |count: usize, times: &mut [Vec<Duration>; 2]| -> Result<()> {
            for ((talks, times), (sources, ears)) in talks.iter_mut().zip(times).zip([(0, false), (sources, ears)]) {
                let talks = talks.as_mut().map_err(|e| Error::new(e.kind(), e.to_string()))?;
                for _ in 0..count {
                    talks.hear()?;
                    sound(talks, sources, ears)?;
                    times.push(talks.compute(None, || 0)?.0);
                }
            }
            Ok(())
        };
        turn(WARM_UP, &mut [Vec::new(), Vec::new()])?;
        while times[0].len() < blocks {
            turn(TURN.min(blocks - times[0].len()), &mut times)?;
        }
        let block_ms = times.map(|mut times| Times::of(&mut times));
        Ok(Self { sampler: made_with(engine, sampler), threads, sources, ears, blocks, block_ms })
    }
}

/// Pushes a block of each source, on a circle around the agent, and of the ears.
fn sound(talks: &mut Talks, sources: u32, ears: bool) -> Result<()> {
    let samples: Vec<f32> = (0..BLOCK_SAMPLES).map(|i| 0.4 * (0.3 * i as f32).sin()).collect();
    for session in &mut talks.sessions {
        for id in 0..sources {
            let angle = 0.7 + id as f32;
            session.push_sound(id, &samples, SAMPLE_RATE, Vec3::new(2.0 * angle.sin(), 1.2, 2.0 * angle.cos()))?;
        }
        if ears {
            session.push_ears(&samples, &samples, SAMPLE_RATE)?;
        }
    }
    Ok(())
}
