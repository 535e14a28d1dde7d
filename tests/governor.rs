//! Sessions under the deadline governor, with a clock that the test makes up.

mod common;

use common::{Inputs, poll_blocks, run, tiny};
use visavis::internals::session::Anchoring;
use visavis::replay::Hold;
use visavis::{Budget, ErrorKind, Frame, Governor, Sampler, Session, SessionOptions};

/// Milliseconds of the last block on a device that is `slow` times slower than one that does eight
/// evaluations in 40 ms.
fn clock(session: &Session, slow: f64) -> f64 {
    let plan = session.decisions().last().expect("a decision").plan;
    let work = match plan.hold {
        Hold::No => 8.0 + 4.0 * plan.sampler.evaluations() as f64,
        Hold::Rehearse => 4.0,
        Hold::Yes => 0.0,
    };
    let passes = plan.catch_up.map_or(0.0, |(n, _)| 6.0 * f64::from(n));
    slow * (work + passes + if plan.anchor { 6.0 } else { 0.0 })
}

fn options() -> SessionOptions {
    let governor = Governor::Budget(Budget { milliseconds: 100.0, coarse: false });
    SessionOptions { governor, gaze: Some(0.8), diagnostics: Anchoring::Every(40).into(), ..Default::default() }
}

/// Polls `blocks` blocks and reports their times; returns the frames and the number of late blocks.
fn drive(session: &mut Session, blocks: usize, slow: impl Fn(usize) -> f64) -> (Vec<Frame>, usize) {
    let (mut frames, mut late) = (Vec::new(), 0);
    for block in 0..blocks {
        frames.extend(poll_blocks(session, 1));
        let ms = clock(session, slow(block));
        late += usize::from(ms > 100.0);
        session.report_block_time(ms).unwrap();
    }
    (frames, late)
}

/// Fast, then hot for half a minute, then too slow for anything, then fast again.
fn day(block: usize) -> f64 {
    match block {
        0..100 => 0.8,
        100..325 => 0.8 + (block - 100) as f64 * 0.01,
        325..400 => 3.0,
        400..500 => 12.0,
        _ => 0.8,
    }
}

#[test]
fn heat_is_answered_before_a_deadline_is_missed() {
    let mut session = tiny().session(options()).unwrap();
    let (frames, late) = drive(&mut session, 400, day);
    assert_eq!((late, session.stats().governor.missed), (0, 0));
    let made = |sampler| frames.iter().any(|f| f.sampler == sampler);
    assert!(made(Sampler::Midpoint4) && made(Sampler::Midpoint2) && made(Sampler::Single));
    assert_eq!(frames.last().map(|f| f.sampler), Some(Sampler::Single));
    assert!(frames.iter().all(|f| f.held == 0.0));
}

#[test]
fn too_slow_for_anything_is_held_and_told() {
    let mut session = tiny().session(options()).unwrap();
    let (frames, late) = drive(&mut session, 900, day);
    let held = frames.iter().filter(|f| f.held == 1.0).count();
    let stats = session.stats().governor;
    assert!(stats.held_blocks >= 80 && held >= 4 * 80, "{stats:?}");
    assert!(late <= 6 && stats.missed as usize == late, "{late} late blocks, {stats:?}");
    let last = frames.last().unwrap();
    assert_eq!((last.held, last.sampler), (0.0, Sampler::Midpoint4), "and back");
    assert!(stats.up >= 2 && stats.down >= 2 && stats.catch_up_passes > 0, "{stats:?}");
    // Breathing is slow, easing is smooth: while a pose is held no joint is faster than 1 m/s.
    for pair in frames.windows(2).filter(|w| w[0].held == 1.0 && w[1].held == 1.0).skip(30) {
        for (a, b) in pair[0].global.iter().zip(&pair[1].global) {
            assert!(a.position.distance(b.position) < 1.0 / 30.0);
        }
    }
    assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite()));
}

/// What one session decided, another does: the same bits, without a clock.
#[test]
fn decisions_replay_bit_for_bit() {
    let inputs = Inputs::circling(common::block_seconds(700), 24_000);
    let engine = tiny();
    let mut session = engine.session(options()).unwrap();
    let first = run(&mut session, &inputs, 1);
    session.report_block_time(10.0).unwrap();
    let (mut frames, _) = drive(&mut session, 600, day);
    frames.splice(0..0, first);
    let decisions: Vec<_> = session.decisions().collect();
    assert!(decisions.len() > 8 && decisions.windows(2).all(|w| w[0].block < w[1].block), "{decisions:?}");
    assert_eq!(session.stats().governor.forgotten_decisions, 0);

    let governor = Governor::Replay(decisions.clone().into());
    let mut again = engine.session(SessionOptions { governor, ..options() }).unwrap();
    let replayed = run(&mut again, &inputs, 601);
    let differs = frames.iter().zip(&replayed).position(|(a, b)| a != b);
    assert_eq!(differs, None, "first frame that differs");
    assert_eq!(again.decisions().collect::<Vec<_>>(), decisions);
}

/// Without a governor nothing depends on time; and the caller may take the choice back at any
/// moment.
#[test]
fn a_pinned_sampler_stays() {
    let inputs = Inputs::circling(common::block_seconds(60), 24_000);
    let engine = tiny();
    let pinned = SessionOptions { governor: Governor::Off, ..options() };
    let plain = run(&mut engine.session(pinned.clone()).unwrap(), &inputs, 60);
    let mut slow = engine.session(pinned).unwrap();
    let mut frames = run(&mut slow, &inputs, 1);
    slow.report_block_time(1e6).unwrap();
    frames.extend(drive(&mut slow, 59, |_| 50.0).0);
    assert_eq!(frames, plain);
    assert_eq!(slow.stats().governor.missed, 0);

    let mut session = engine.session(options()).unwrap();
    drive(&mut session, 30, |_| 1.0);
    session.set_governor(Governor::Off).unwrap();
    session.set_sampler(Sampler::Midpoint1).unwrap();
    let (frames, _) = drive(&mut session, 30, |_| 50.0);
    assert!(frames.iter().all(|f| f.sampler == Sampler::Midpoint1));
    session.set_sampler(Sampler::Midpoint2).unwrap();
    session.set_governor(options().governor).unwrap();
    let (frames, _) = drive(&mut session, 60, |_| 0.3);
    assert!(
        frames.iter().all(|f| matches!(f.sampler, Sampler::Midpoint2 | Sampler::Single)),
        "the best is what was set"
    );
    assert_eq!(frames.last().map(|f| f.sampler), Some(Sampler::Midpoint2));
}

#[test]
fn bad_budgets_and_times_are_refused() {
    let engine = tiny();
    for milliseconds in [0.0, -3.0, f32::NAN, 134.0] {
        let governor = Governor::Budget(Budget { milliseconds, coarse: false });
        let refused = engine.session(SessionOptions { governor: governor.clone(), ..Default::default() });
        assert_eq!(refused.unwrap_err().kind(), ErrorKind::Argument);
        let mut session = engine.session(SessionOptions::default()).unwrap();
        assert_eq!(session.set_governor(governor).unwrap_err().kind(), ErrorKind::Argument);
    }
    let mut session = engine.session(options()).unwrap();
    for ms in [f64::NAN, -1.0, f64::INFINITY] {
        assert_eq!(session.report_block_time(ms).unwrap_err().kind(), ErrorKind::Argument);
    }
    session.report_block_time(5.0).unwrap();
}

/// The measured clock of `poll` works as well: on any computer the tiny model fits a generous
/// budget.
#[test]
fn without_a_reported_time_the_session_measures() {
    let mut session = tiny().session(options()).unwrap();
    let frames = poll_blocks(&mut session, 200);
    assert_eq!(frames.len(), 800);
    assert!(session.decisions().count() >= 1);
}
