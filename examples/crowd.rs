//! Two hundred agents who look at one walking user, stepped together on one core: what they cost.
//!
//! `cargo run --release --example crowd -- [BUNDLE [AGENTS [SECONDS]]]`, by default the shipped
//! bundle of the featherweight tier, 200 agents, 20 seconds of motion.

use std::error::Error;
use std::time::Instant;
use visavis::glam::{Quat, Vec3};
use visavis::{BLOCK_FRAMES, Engine, FPS, Root, SAMPLE_RATE, Session, SessionOptions};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let bundle = args.next().unwrap_or_else(|| "models/visavis-dram-i8.safetensors".into());
    let agents: usize = args.next().map_or(Ok(200), |n| n.parse())?;
    let seconds: f64 = args.next().map_or(Ok(20.0), |n| n.parse())?;
    if agents == 0 || !(1.0..=3600.0).contains(&seconds) {
        return Err("at least one agent, and 1 to 3600 seconds".into());
    }

    let engine = Engine::load(bundle)?;
    let mut team = engine.team(1)?;
    // Rings around the square that the user walks in, everyone facing its middle.
    let session = |i: usize| {
        let (angle, radius) = (2.399_963 * i as f64, 2.5 + 0.35 * (i as f64).sqrt());
        let (x, z) = (radius * angle.sin(), radius * angle.cos());
        let start = Root { x, z, yaw: (-x).atan2(-z) };
        // Sound comes as it is heard: half a second of it is room enough.
        let options = SessionOptions { seed: i as u64, gaze: Some(0.9), start, voice_ahead: 0.5, ..Default::default() };
        engine.session(options)
    };
    let mut crowd: Vec<Session> = (0..agents).map(session).collect::<Result<_, _>>()?;

    let blocks = (seconds * f64::from(FPS) / BLOCK_FRAMES as f64) as usize;
    let sound = SAMPLE_RATE as usize * BLOCK_FRAMES / FPS as usize;
    let mut times = Vec::with_capacity(blocks);
    let (mut gaze, mut dyadic) = ([0.0f64; 2], [0.0f64; 2]);
    for block in 0..blocks {
        let now = crowd[0].next_due();
        // The user walks on an eight, looks where he goes, and speaks every other three seconds.
        let at = |t: f64| Vec3::new((1.8 * (0.5 * t).sin()) as f32, 1.65, (0.9 * (1.0 * t).sin()) as f32);
        let ahead = at(now + 0.1) - at(now);
        let rotation = Quat::from_rotation_y(ahead.x.atan2(ahead.z));
        let speaks = ((now / 3.0) as u64).is_multiple_of(2);
        let tone = |i: usize| {
            let t = (block * sound + i) as f32 / SAMPLE_RATE as f32;
            if speaks { 0.2 * (900.0 * t).sin() * (23.0 * t).sin().max(0.0) } else { 0.0 }
        };
        let voice: Vec<f32> = (0..sound).map(tone).collect();
        for session in &mut crowd {
            session.push_user_pose(at(now), Some(rotation), now)?;
            session.push_user_audio(&voice, SAMPLE_RATE)?;
        }
        let mut due: Vec<_> = crowd.iter_mut().map(|session| (session, now)).collect();
        let started = Instant::now();
        team.step(&mut due)?;
        times.push(1000.0 * started.elapsed().as_secs_f64());
        for frame in crowd.iter().filter_map(Session::frames).flatten() {
            if let Some(score) = frame.gaze {
                gaze = [gaze[0] + f64::from(score), gaze[1] + 1.0];
            }
            let share = frame.dyadic.iter().sum::<f32>() / frame.dyadic.len().max(1) as f32;
            dyadic = [dyadic[0] + f64::from(share), dyadic[1] + 1.0];
        }
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((share * times.len() as f64) as usize).min(times.len() - 1)];
    let budget = 1000.0 * BLOCK_FRAMES as f64 / f64::from(FPS);
    println!("{}: {agents} agents, {seconds} s of motion, one thread, {}", engine.name(), engine.cpu_level());
    println!("  block of all  p50 {:.2}, p95 {:.2}, max {:.2} ms of {budget:.1} ms", at(0.5), at(0.95), at(1.0));
    println!(
        "  an agent      {:.3} ms a block, {:.2} % of a core",
        at(0.5) / agents as f64,
        at(0.5) / budget / agents as f64 * 100.0
    );
    println!("  a core has    {:.0} agents in real time", budget / at(0.5) * agents as f64);
    println!("  state         {:.1} KB an agent, beside its voices", crowd[0].stats().cache_bytes as f64 / 1024.0);
    println!("  shared        {} of {} blocks", team.shared_blocks(), agents * blocks);
    println!("  gaze          {:.2} on average (1: at the user's eyes)", gaze[0] / gaze[1].max(1.0));
    println!("  dyadic        {:.2} on average", dyadic[0] / dyadic[1].max(1.0));
    Ok(())
}
