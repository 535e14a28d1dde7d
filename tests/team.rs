//! Sessions that are stepped together show what each shows by itself, bit for bit.

mod common;

use common::{Inputs, dram, dram_in, tiny, tiny_in};
use std::sync::Arc;
use visavis::internals::kernels::Scheme;
use visavis::internals::session::{Anchoring, Diagnostics};
use visavis::{Budget, Engine, ErrorKind, Frame, Governor, Root, Sampler, Session, SessionOptions};

const BLOCKS: usize = 60;

/// Six conversations that differ in all that may differ; most are at times alike.
fn sessions(engine: &Arc<Engine>, inputs: &Inputs) -> Vec<Session> {
    let usual = SessionOptions { diagnostics: Anchoring::Every(12).into(), ..Default::default() };
    let late = Diagnostics { first_block: 1000, ..usual.diagnostics.clone() };
    let options = [
        usual.clone(),
        SessionOptions { seed: 1, gaze: Some(0.7), guidance: Some(2.0), ..usual.clone() },
        SessionOptions { seed: 2, diagnostics: late, temperature: Some(0.5), ..usual.clone() },
        SessionOptions { seed: 3, sampler: Sampler::Single, ..usual.clone() },
        SessionOptions { seed: 4, sampler: Sampler::euler(3).unwrap(), ..usual.clone() },
        SessionOptions { seed: 5, sampler: Sampler::Single, diagnostics: Anchoring::Never.into(), ..usual },
    ];
    let session = |options: SessionOptions| {
        let mut session = engine.session(options).expect("session");
        session.push_agent_audio(&inputs.agent, inputs.rate).expect("agent audio");
        session.push_user_audio(&inputs.user, inputs.rate).expect("user audio");
        inputs.path.iter().for_each(|(time, position)| session.push_user_head(*position, *time).expect("head"));
        session
    };
    options.into_iter().map(session).collect()
}

/// What happens to session `i` before its block `block`.
fn event(session: &mut Session, i: usize, block: usize) {
    if (i, block) == (0, 20) || (i, block) == (1, 30) {
        session.set_gaze((i == 0).then_some(0.2)).expect("gaze");
    }
    if i == 2 && (25..40).contains(&block) && block.is_multiple_of(5) {
        let sampler = [Sampler::Midpoint1, Sampler::Single, Sampler::Midpoint4][block / 5 % 3];
        session.set_sampler(sampler).expect("sampler");
    }
}

fn same(a: &[Frame], b: &[Frame]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b)
}

#[test]
fn together_and_alone_are_the_same_bits() {
    let inputs = Inputs::circling(common::block_seconds(BLOCKS), 24_000);
    let flow = [(tiny(), 1), (tiny_in(Scheme::I8), 2), (tiny_in(Scheme::I4), 1)];
    for (engine, threads) in flow.into_iter().chain([(dram("lstm"), 1), (dram_in("tcn", Scheme::I8), 2)]) {
        let mut alone = sessions(&engine, &inputs);
        let mut together = sessions(&engine, &inputs);
        let mut team = engine.team(threads).expect("team");
        for block in 0..BLOCKS {
            let mut due: Vec<_> = together
                .iter_mut()
                .enumerate()
                .map(|(i, session)| {
                    event(session, i, block);
                    let now = session.next_due();
                    (session, now)
                })
                .collect();
            assert_eq!(team.step(&mut due).expect("step"), due.len());
            assert_eq!(team.step(&mut due).expect("step"), 0, "nobody is due twice");
            for (i, (alone, together)) in alone.iter_mut().zip(&together).enumerate() {
                event(alone, i, block);
                let frames = alone.poll(alone.next_due()).expect("poll").expect("a block is due");
                assert!(same(frames, together.frames().expect("frames")), "session {i}, block {block}");
            }
        }
        let shared = team.shared_blocks();
        let all = 6 * BLOCKS as u64;
        match engine.kind() {
            "dram" => assert_eq!(shared, all, "without samplers all share"),
            _ => assert!(shared > all / 3 && shared < all, "{shared} blocks shared passes"),
        }
    }
}

/// More agents than go into one pass, some of whom have nothing to hear or to see.
#[test]
fn a_crowd_has_the_bits_of_each_alone() {
    let engine = dram_in("tcn", Scheme::I8);
    let inputs = Inputs::circling(2.0, 24_000);
    let crowd = || -> Vec<Session> {
        let session = |i: usize| {
            let start = Root { x: i as f64, z: -1.0, yaw: 0.1 * i as f64 };
            let options = SessionOptions { start, gaze: (i.is_multiple_of(3)).then_some(0.8), ..Default::default() };
            let mut session = engine.session(options).expect("session");
            if i.is_multiple_of(2) {
                session.push_agent_audio(&inputs.agent[i * 10..], inputs.rate).expect("agent audio");
            }
            let turned = (i.is_multiple_of(4)).then(|| glam::Quat::from_rotation_y(0.05 * i as f32));
            for (time, position) in inputs.path.iter().filter(|_| !i.is_multiple_of(5)) {
                session.push_user_pose(*position, turned, *time).expect("head");
            }
            session
        };
        (0..70).map(session).collect()
    };
    let (mut alone, mut together, mut team) = (crowd(), crowd(), engine.team(1).expect("team"));
    for block in 0..12 {
        let mut due: Vec<_> = together.iter_mut().map(|session| (session, f64::from(block) * 4.0 / 30.0)).collect();
        assert_eq!(team.step(&mut due).expect("step"), 70);
        for (i, (alone, together)) in alone.iter_mut().zip(&together).enumerate() {
            let frames = alone.poll(alone.next_due()).expect("poll").expect("a block is due");
            assert!(same(frames, together.frames().expect("frames")), "agent {i}, block {block}");
        }
    }
    assert_eq!(team.shared_blocks(), 70 * 12);
}

#[test]
fn only_those_that_are_due_are_stepped() {
    let engine = tiny();
    let mut team = engine.team(1).expect("team");
    let mut a = engine.session(SessionOptions::default()).expect("session");
    let mut b = engine.session(SessionOptions { seed: 1, ..Default::default() }).expect("session");
    assert!(a.frames().is_none());
    assert_eq!(team.step(&mut [(&mut a, 0.0), (&mut b, 0.0)]).expect("step"), 2);
    assert_eq!(team.step(&mut [(&mut a, 0.2), (&mut b, 0.1)]).expect("step"), 1);
    assert_eq!((a.frames().expect("frames")[0].index, b.frames().expect("frames")[0].index), (4, 0));
    assert_eq!(team.step(&mut []).expect("step"), 0);
    assert_eq!(team.step(&mut [(&mut b, 0.3)]).expect("a session may be stepped by itself"), 1);
    assert_eq!(b.poll(0.3).expect("poll").map(|frames| frames[0].index), Some(8), "and go on alone");
}

#[test]
fn governed_sessions_count_their_share() {
    let engine = tiny();
    let mut team = engine.team(1).expect("team");
    let options = SessionOptions { governor: Governor::Budget(Budget::default()), ..Default::default() };
    let mut sessions = [0, 1].map(|seed| engine.session(SessionOptions { seed, ..options.clone() }).expect("session"));
    for _ in 0..10 {
        let [a, b] = &mut sessions;
        let (now_a, now_b) = (a.next_due(), b.next_due());
        assert_eq!(team.step(&mut [(a, now_a), (b, now_b)]).expect("step"), 2);
    }
    for session in &sessions {
        let stats = session.stats();
        assert!(stats.blocks == 10 && stats.block_ms[0] > 0.0, "{stats:?}");
    }
}

#[test]
fn what_cannot_be_stepped_is_refused_before_anything_is_computed() {
    let (engine, other) = (tiny(), tiny());
    let mut team = engine.team(1).expect("team");
    let mut ours = engine.session(SessionOptions::default()).expect("session");
    let mut theirs = other.session(SessionOptions::default()).expect("session");
    let refused = team.step(&mut [(&mut ours, 0.0), (&mut theirs, 0.0)]).expect_err("another engine's");
    assert_eq!(refused.kind(), ErrorKind::Argument);
    let refused = team.step(&mut [(&mut ours, f64::NAN)]).expect_err("not a time");
    assert_eq!(refused.kind(), ErrorKind::Argument);
    assert!(ours.frames().is_none());
    assert_eq!(team.step(&mut [(&mut ours, 1.0)]).expect("step"), 1);
    let refused = team.step(&mut [(&mut ours, 0.5)]).expect_err("time does not run backwards");
    assert_eq!(refused.kind(), ErrorKind::State);
    assert_eq!(engine.team(3).expect_err("one or two threads").kind(), ErrorKind::Argument);
}
