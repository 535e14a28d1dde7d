//! A session in real-time style: a simulated application that plays one agent to one user.
//!
//! ```text
//! cargo run --release --example stream [-- BUNDLE]
//! ```
//!
//! Three things happen at their own rates, as they do on a headset: a sound card delivers 10 ms of
//! the user's voice at 48 kHz, a tracker tells the user's head 90 times per second, and the
//! renderer wants a pose 30 times per second. The clock is simulated, so the example runs as fast
//! as it can; a real application passes its own clock to the same calls.
//!
//! The user walks half a circle around the agent while the agent speaks and then listens. Once a
//! second the program prints where the agent stands, where it looks, and how it keeps up.

use glam::Vec3;
use std::collections::VecDeque;
use std::f32::consts::{PI, TAU};
use visavis::{Engine, Frame, Result, SessionOptions};

const SECONDS: u32 = 12;
const AUDIO_RATE: u32 = 48_000;

fn main() -> Result<()> {
    let bundle = std::env::args().nth(1).unwrap_or_else(|| "models/visavis-room-i8.safetensors".to_owned());
    // Once an application: weights are packed for this CPU. Any number of sessions share the
    // engine.
    let engine = Engine::load(&bundle)?;
    // Once a user: all memory that the session will need is taken here.
    let mut session = engine.session(SessionOptions { seed: 1, ..SessionOptions::default() })?;
    let head = engine.rig().index("head").unwrap_or(0);
    println!("{}: {} joints, kernels {}", engine.name(), engine.rig().len(), engine.cpu_level());

    // What the agent says is known ahead (text-to-speech), so it is pushed as a whole utterance, at
    // the voice's own rate.
    session.push_agent_audio(&babble(0.0, 5.0, 130.0, 22_050), 22_050)?;

    let mut shown: Option<Frame> = None;
    let mut ready: VecDeque<Frame> = VecDeque::new();
    // A common multiple of the three rates: 90 ticks of the tracker, 30 of the renderer, 100 of the
    // sound card a second.
    const TICKS: u32 = 900;
    for tick in 0..SECONDS * TICKS {
        let now = f64::from(tick) / f64::from(TICKS);
        if tick % (TICKS / 100) == 0 {
            // The sound card hands over what was said in the last 10 ms. The user speaks from
            // second 6 to 10.
            session.push_user_audio(&babble(now - 0.01, now, 210.0, AUDIO_RATE), AUDIO_RATE)?;
        }
        if tick % (TICKS / 90) == 0 {
            session.push_user_head(walk(now as f32), now)?;
        }
        if tick == 8 * TICKS {
            // Anything may change while the session runs: from now on, hold eye contact.
            session.set_gaze(Some(1.0))?;
        }
        if tick % (TICKS / 30) == 0 {
            // Four frames come at once, when their block is due; they are shown one by one.
            while let Some(frames) = session.poll(now)? {
                ready.extend(frames.iter().cloned());
            }
            shown = ready.pop_front();
        }
        if let Some(frame) = shown.as_ref().filter(|_| tick % TICKS == 0) {
            print_second(frame, head);
        }
    }

    let stats = session.stats();
    let [p50, p95, _, max] = stats.block_ms;
    println!("{} blocks of 133.3 ms: p50 {p50:.1}, p95 {p95:.1}, max {max:.1} ms of computation", stats.blocks);
    println!(
        "a block answers what the user did up to {:.0} ms before it; head positions taken: {}",
        stats.delays.user_ms, stats.inputs.head.accepted
    );
    Ok(())
}

fn print_second(frame: &Frame, head: usize) {
    let (root, eyes) = (&frame.root, frame.global[head].position);
    let gaze = frame.gaze.map_or_else(|| "  none".to_owned(), |g| format!("{g:+.2}"));
    println!(
        "t {:5.2} s  stands at ({:+.2}, {:+.2}) m, heading {:+4.0} deg, head {:.2} m high, gaze {gaze}, {}",
        frame.time,
        root.x,
        root.z,
        root.yaw.to_degrees(),
        eyes.y,
        frame.sampler
    );
}

/// The user's head at `t` seconds: half a circle of 1.5 m around the agent in 10 s, from in front
/// of it.
fn walk(t: f32) -> Vec3 {
    let angle = PI * (t / 10.0).min(1.0);
    Vec3::new(1.5 * angle.sin(), 1.65, 1.5 * angle.cos())
}

/// Stands in for a voice: a buzz in syllables, from `from` to `to` seconds. The deep one speaks at
/// once, the high one from second 6 to 10.
fn babble(from: f64, to: f64, pitch: f32, rate: u32) -> Vec<f32> {
    let first = (from * f64::from(rate)).round() as i64;
    let last = (to * f64::from(rate)).round() as i64;
    let speaks = |t: f32| pitch < 200.0 || (6.0..10.0).contains(&t);
    (first.max(0)..last)
        .map(|i| {
            let t = i as f32 / rate as f32;
            let syllable = (TAU * 3.5 * t).sin().max(0.0).powi(2);
            let buzz: f32 = (1..6).map(|h| (TAU * pitch * h as f32 * t).sin() / h as f32).sum();
            if speaks(t) { 0.2 * syllable * buzz } else { 0.0 }
        })
        .collect()
}
