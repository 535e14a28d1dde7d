//! Sessions that go on: re-anchoring changes neither where the agent is nor how it moves, and
//! numbers stay in range.

mod common;

use common::{Inputs, motion, poll_blocks, run, tiny};
use visavis::internals::session::{Anchoring, Diagnostics, Probe};
use visavis::{Frame, SessionOptions};

/// Largest step of any joint from one frame to the next, metres.
fn largest_step(frames: &[Frame]) -> f32 {
    let step = |w: &[Frame]| {
        let joints = w[0].global.iter().zip(&w[1].global);
        joints.map(|(a, b)| a.position.distance(b.position)).fold(0.0, f32::max)
    };
    frames.windows(2).map(step).fold(0.0, f32::max)
}

#[derive(Default)]
struct Range {
    latent: f32,
    user: f32,
}

impl Probe for Range {
    fn stage(&mut self, _block: u64, name: &'static str, values: &[f32]) {
        let largest = values.iter().fold(0.0, |m: f32, v| m.max(v.abs()));
        assert!(largest.is_finite(), "{name}");
        match name {
            "latents" => self.latent = self.latent.max(largest),
            "conditioning.user" => self.user = self.user.max(largest),
            _ => {}
        }
    }
}

/// Ten minutes with a user who walks in circles, re-anchoring every 8 s.
#[test]
fn ten_minutes_in_circles() {
    let blocks = 4500;
    let inputs = Inputs::circling(common::block_seconds(blocks), 24_000);
    let session = |anchoring| {
        let options =
            SessionOptions { diagnostics: Diagnostics::from(anchoring), gaze: Some(0.8), ..Default::default() };
        tiny().session(options).unwrap()
    };
    let drive = |anchoring| {
        let mut session = session(anchoring);
        let mut range = Range::default();
        let (mut frames, mut path) = (Vec::new(), inputs.path.iter().peekable());
        for block in 0..blocks {
            let now = session.next_due();
            let samples = block * 3200..(block + 1) * 3200;
            session.push_agent_audio(&inputs.agent[samples.clone()], 24_000).unwrap();
            session.push_user_audio(&inputs.user[samples], 24_000).unwrap();
            while let Some((time, position)) = path.next_if(|(time, _)| *time <= now) {
                session.push_user_head(*position, *time).unwrap();
            }
            frames.extend_from_slice(session.poll_with(now, Some(&mut range)).unwrap().unwrap());
        }
        (frames, range, session.stats().anchorings)
    };
    let (plain, plain_range, none) = drive(Anchoring::Never);
    let (anchored, range, many) = drive(Anchoring::Every(60));
    assert_eq!(none, 0);
    assert!(many >= 40, "{many} anchorings in ten minutes");
    // The world cannot jump: a re-anchoring moves no joint further in a frame than motion without
    // it does.
    let (without, with) = (largest_step(&plain), largest_step(&anchored));
    println!("largest step without {without} m, with {with} m; latents {} and {}", plain_range.latent, range.latent);
    assert!(with < 1.5 * without, "largest step {with} m against {without} m without");
    // Latents are standardised: unit scale. The user is 1.7 m from the origin.
    assert!(range.latent < 2.0 * plain_range.latent.max(4.0), "latents reach {}", range.latent);
}

/// Until the first re-anchoring has replaced a latent nothing differs, afterwards something does.
#[test]
fn re_anchoring_takes_effect_when_it_says() {
    let inputs = Inputs::circling(common::block_seconds(60), 24_000);
    let options = |anchoring| SessionOptions { diagnostics: Diagnostics::from(anchoring), ..Default::default() };
    let plain = motion(options(Anchoring::Never), &inputs, 60);
    let anchored = motion(options(Anchoring::Every(30)), &inputs, 60);
    let first = plain.iter().zip(&anchored).position(|(a, b)| a.global != b.global).expect("it has an effect");
    // Idle blocks count too: the tiny bundle has four.
    assert!(first >= (30 - 4) * 4, "first difference in frame {first}");
}

/// The agent starts where it is told, and everything else is the same relative to that.
#[test]
fn start_moves_the_whole_scene() {
    let inputs = Inputs::circling(common::block_seconds(20), 24_000);
    let base = motion(SessionOptions::default(), &inputs, 20);
    let start = visavis::Root { x: 40.0, z: -25.0, yaw: 2.0 };
    let mut moved_inputs = inputs.clone();
    moved_inputs.path.iter_mut().for_each(|(_, p)| *p = start.to_world(*p));
    let moved = motion(SessionOptions { start, ..Default::default() }, &moved_inputs, 20);
    for (a, b) in base.iter().zip(&moved) {
        for (a, b) in a.global.iter().zip(&b.global) {
            let error = start.to_world(a.position).distance(b.position);
            assert!(error < 2e-3, "{error} m: f32 positions 47 m out resolve 4e-6 m, 20 blocks of feedback amplify it");
        }
    }
}

/// A pinned sampler may rest for longer than a window and come back.
#[test]
fn long_rest_of_a_sampler() {
    use visavis::Sampler;
    let inputs = Inputs::circling(common::block_seconds(70), 24_000);
    let mut session = tiny().session(SessionOptions::default()).unwrap();
    run(&mut session, &inputs, 5);
    session.set_sampler(Sampler::Single).unwrap();
    poll_blocks(&mut session, 40);
    session.set_sampler(Sampler::Midpoint4).unwrap();
    let frames = poll_blocks(&mut session, 20);
    assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite()));
}
