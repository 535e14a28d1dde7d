//! After a day: everything that counts tokens, frames or samples is as precise as in the first
//! minute.

mod common;

use common::{Inputs, poll_blocks, tiny};
use visavis::internals::nn::PERIOD;
use visavis::internals::session::{Anchoring, Diagnostics};
use visavis::{BLOCK_FRAMES, FPS, Frame, Sampler, Session, SessionOptions};

const DAY: u64 = 24 * 3600 * FPS as u64 / BLOCK_FRAMES as u64;
const BLOCKS: usize = 60;

/// The same noise and the same inputs, in a session that starts at `first_block`.
fn starting(first_block: u64) -> SessionOptions {
    SessionOptions { diagnostics: Diagnostics { first_block, ..Default::default() }, ..Default::default() }
}

fn motion(first_block: u64, sampler: Sampler) -> (Vec<Frame>, Session) {
    let engine = tiny();
    let latent = engine.config().vae.latent;
    let tokens = engine.idle_blocks() + BLOCKS;
    let noise: Vec<f32> = (0..tokens * latent).map(|i| ((i * i) as f32 * 0.7).sin()).collect();
    let diagnostics = Diagnostics { first_block, anchoring: Anchoring::Every(20), ..Default::default() };
    let options = SessionOptions { sampler, gaze: Some(0.8), diagnostics, ..Default::default() };
    let mut session = engine.session(options).unwrap();
    session.reset_with_noise(noise).unwrap();
    let start = session.next_due();
    assert_eq!(start, first_block as f64 * BLOCK_FRAMES as f64 / f64::from(FPS));
    let inputs = Inputs::circling(common::block_seconds(BLOCKS), 48_000);
    session.push_agent_audio(&inputs.agent, inputs.rate).unwrap();
    session.push_user_audio(&inputs.user, inputs.rate).unwrap();
    for (i, (t, p)) in inputs.path.iter().enumerate() {
        // Every third sample falls on a frame, to the bit; what lies between two samples would
        // depend on how their times round.
        let frame = first_block * BLOCK_FRAMES as u64 + i as u64 / 3;
        let time = if i % 3 == 0 { frame as f64 / f64::from(FPS) } else { start + t };
        session.push_user_head(*p, time).unwrap();
    }
    (poll_blocks(&mut session, BLOCKS), session)
}

/// All phases come again after a period: everything else that knows the time must not change a bit
/// either.
#[test]
fn whole_periods_later_motion_has_the_same_bits() {
    for sampler in [Sampler::Midpoint4, Sampler::Single] {
        let (now, _) = motion(0, sampler);
        for periods in [1, 4] {
            let (later, _) = motion(periods * PERIOD, sampler);
            for (a, b) in now.iter().zip(&later) {
                assert_eq!(*a, Frame { index: a.index, time: a.time, ..b.clone() }, "{sampler}, {periods} periods");
            }
        }
        let (other, _) = motion(PERIOD + 1, sampler);
        assert!(now.iter().zip(&other).any(|(a, b)| a.global != b.global), "keys are rounded at other angles");
    }
}

/// Positions of tokens enter through rotary phases, which are relative: but for their rounding,
/// motion does not know the hour.
#[test]
fn a_day_later_motion_is_the_same() {
    for sampler in [Sampler::Midpoint4, Sampler::Single] {
        let (now, first) = motion(0, sampler);
        for blocks in [DAY, 7 * DAY, 60_000_000] {
            let (later, session) = motion(blocks, sampler);
            let mut error = 0f32;
            for (a, b) in now.iter().zip(&later) {
                assert_eq!(b.index, a.index + blocks * BLOCK_FRAMES as u64);
                assert!((b.time - b.index as f64 / f64::from(FPS)).abs() < 1e-6, "time stamps");
                let joints = a.global.iter().zip(&b.global);
                error = joints.map(|(a, b)| a.position.distance(b.position)).fold(error, f32::max);
            }
            println!("{sampler}, block {blocks}: {error} m over {BLOCKS} blocks");
            // Eight seconds of feedback amplify what the last bits of the phases differ by.
            assert!(error < 2e-3, "{sampler}, block {blocks}: {error} m");
            assert_eq!(session.stats().inputs, first.stats().inputs, "every sample was heard when it was due");
            assert_eq!(session.stats().blocks, BLOCKS as u64);
        }
    }
}

/// Seeded noise is as good after a day, and the head is still found.
#[test]
fn a_day_later_counters_go_on() {
    let mut session = tiny().session(starting(DAY)).unwrap();
    let mut early = tiny().session(SessionOptions::default()).unwrap();
    assert!(session.poll(0.0).unwrap().is_none(), "not due yet");
    session.push_user_head(glam::Vec3::new(0.0, 1.6, 2.0), 86_400.0).unwrap();
    let (late, early) = (poll_blocks(&mut session, 30), poll_blocks(&mut early, 30));
    assert!(late[4].gaze.is_some(), "the head is seen");
    assert_ne!(late[40].global, early[40].global, "other tokens, other noise");
    assert!(late.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite()));
    let kind = tiny().session(starting(1 << 40)).unwrap_err().kind();
    assert_eq!(kind, visavis::ErrorKind::Argument);
}
