//! What a body at rest is told: in whose company it is, what the calibration makes of that, and that
//! it is told nothing while it speaks.

mod common;

use common::{golden_path, tiny};
use glam::Vec3;
use std::sync::Arc;
use visavis::internals::config::{Config, ResponseCurve, RestConfig, RestResponse};
use visavis::internals::session::Probe;
use visavis::{BundleFile, Engine, ErrorKind, FPS, Result, Sampler, SessionOptions};

const BLOCKS: u64 = 40;
const SECONDS: f32 = 6.0;

/// The reference network is told what is wanted, the student half as much more.
fn rest() -> RestConfig {
    let response = |more: f32| RestResponse {
        curves: std::array::from_fn(|_| ResponseCurve(vec![[-2.0, more - 2.0], [2.0, more + 2.0]])),
        alone: [0.25, 0.0, 0.0],
        listening: [0.0, -0.25, 0.5],
        seconds: 10.0,
    };
    RestConfig {
        embed: bundle().parse().expect("it can be read").0.rest.expect("it has a way in").embed,
        levels: vec![[0.5, 0.0, -0.5]],
        seconds: 10.0,
        reference: Some(response(0.0)),
        student: Some(response(0.5)),
    }
}

fn bundle() -> BundleFile<'static> {
    BundleFile::open(golden_path("rest.safetensors")).expect("the tiny bundle with rest is there")
}

fn with(rest: RestConfig) -> Result<Arc<Engine>> {
    let file = bundle();
    let settings = Config { rest: Some(rest), ..file.parse()?.0 };
    Engine::from_bytes(file.with_settings(&settings)?, "calibrated")
}

/// What was told by block.
#[derive(Default)]
struct Told(Vec<(u64, [f32; 3])>);

impl Probe for Told {
    fn stage(&mut self, block: u64, name: &'static str, values: &[f32]) {
        if name == "conditioning.activity" {
            self.0.push((block, values.try_into().expect("three values")));
        }
    }
}

/// Blocks of a session in which the agent speaks in its first second if `agent`, the user from the
/// third on if `user`, and a user is seen if `seen`.
fn told(engine: &Arc<Engine>, sampler: Sampler, [agent, user, seen]: [bool; 3]) -> Vec<(u64, [f32; 3])> {
    let mut session = engine.session(SessionOptions { sampler, ..Default::default() }).expect("session");
    let voice = |speaks: bool, from: f32, to: f32| -> Vec<f32> {
        let seconds = |i: usize| i as f32 / 24_000.0;
        let loud = |i: usize| speaks && (from..to).contains(&seconds(i));
        (0..(24_000.0 * SECONDS) as usize).map(|i| if loud(i) { 0.3 * (i as f32 * 0.05).sin() } else { 0.0 }).collect()
    };
    session.push_agent_audio(&voice(agent, 0.0, 1.0), 24_000).expect("agent voice");
    session.push_user_audio(&voice(user, 3.0, SECONDS), 24_000).expect("user voice");
    for i in 0..if seen { (SECONDS * FPS as f32) as usize } else { 0 } {
        session.push_user_head(Vec3::new(0.0, 1.6, 1.5), i as f64 / f64::from(FPS)).expect("head");
    }
    let mut told = Told::default();
    for _ in 0..BLOCKS {
        let now = session.next_due();
        session.poll_with(now, Some(&mut told)).expect("poll").expect("due");
    }
    told.0
}

#[test]
fn what_is_told_depends_on_the_company() {
    let engine = with(rest()).expect("it loads");
    let (wanted, alone, listening) = ([0.5, 0.0, -0.5], [0.75, 0.0, -0.5], [0.5, -0.25, 0.0]);
    let silent = told(&engine, Sampler::Midpoint1, [false, false, true]);
    // Nobody has been seen when the first block is made.
    assert_eq!(silent[0], (0, alone));
    assert_eq!(silent[1..], (1..BLOCKS).map(|block| (block, wanted)).collect::<Vec<_>>());
    let nobody = told(&engine, Sampler::Midpoint1, [false, false, false]);
    assert_eq!(nobody, (0..BLOCKS).map(|block| (block, alone)).collect::<Vec<_>>());
    let heard = told(&engine, Sampler::Midpoint1, [false, true, true]);
    // Speech from 3 s on is in block 22, which block 23 knows.
    assert_eq!((heard[22], heard[23], heard[39]), ((22, wanted), (23, listening), (39, listening)));
    // Speech up to 1 s ends in frame 29, a second later in frame 61: block 15.
    let after = told(&engine, Sampler::Midpoint1, [true, false, true]);
    assert_eq!(after, (15..BLOCKS).map(|block| (block, wanted)).collect::<Vec<_>>());
}

#[test]
fn the_student_has_a_response_of_its_own() {
    let engine = with(rest()).expect("it loads");
    let heard = told(&engine, Sampler::Single, [false, true, true]);
    assert_eq!((heard[10].1, heard[39].1), ([1.0, 0.5, 0.0], [1.0, 0.25, 0.5]));
    let plain = with(RestConfig { reference: None, student: None, ..rest() }).expect("it loads");
    assert_eq!(told(&plain, Sampler::Single, [false, true, true])[39].1, [0.5, 0.0, -0.5], "not calibrated");
    assert!(told(&tiny(), Sampler::Single, [false; 3]).is_empty(), "a bundle that is not told");
}

#[test]
fn a_response_that_makes_no_sense_is_refused() {
    let response = || rest().reference.expect("there is one");
    let curve = |points: Vec<[f32; 2]>| {
        let [_, second, third] = response().curves;
        RestResponse { curves: [ResponseCurve(points), second, third], ..response() }
    };
    let bad = [
        curve(vec![]),
        curve(vec![[0.0, 1.0], [1.0, 1.0]]),
        curve(vec![[0.0, 1.0], [1.0, 5.0]]),
        RestResponse { alone: [0.0, f32::NAN, 0.0], ..response() },
        RestResponse { listening: [0.0, 0.0, 9.0], ..response() },
        RestResponse { seconds: 0.0, ..response() },
    ];
    for response in bad {
        let text = format!("{response:?}");
        let rest = RestConfig { student: Some(response), ..rest() };
        assert_eq!(with(rest).map(|_| ()).unwrap_err().kind(), ErrorKind::BundleInvalid, "{text}");
    }
}
