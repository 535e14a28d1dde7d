//! Sessions under the deadline governor, with a clock that the test makes up.

mod common;

use common::{Inputs, dram, poll_blocks, run, tiny};
use std::sync::Arc;
use visavis::internals::session::Anchoring;
use visavis::replay::Hold;
use visavis::{Budget, Engine, ErrorKind, Frame, Governor, Sampler, Session, SessionOptions};

/// Milliseconds of the last block on a device that is `slow` times slower than one that does eight
/// evaluations in 40 ms.
fn clock(session: &Session, slow: f64) -> f64 {
    let plan = session.decisions().last().expect("a decision").plan;
    let work = match plan.hold {
        Hold::No => 8.0 + 4.0 * plan.sampler.evaluations() as f64,
        Hold::Rehearse => 4.0,
        Hold::Fallback => 0.5,
        Hold::RehearseFallback => 4.5,
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

/// A day with a fallback: motion goes on where it would be held.
fn with_fallback(engine: &Arc<Engine>) -> Session {
    let mut session = engine.session(options()).unwrap();
    session.set_fallback(&dram("tcn")).unwrap();
    session
}

#[test]
fn too_slow_for_anything_is_left_to_the_fallback() {
    let inputs = Inputs::circling(common::block_seconds(901), 24_000);
    let mut session = with_fallback(&tiny());
    let first = run(&mut session, &inputs, 1);
    session.report_block_time(10.0).unwrap();
    let (mut frames, late) = drive(&mut session, 900, day);
    frames.splice(0..0, first);
    let stats = session.stats().governor;
    assert!(stats.fallback_blocks >= 80 && stats.held_blocks == 0, "{stats:?}");
    assert!(late <= 6 && stats.missed as usize == late, "{late} late blocks, {stats:?}");
    let fell_back = |f: &Frame| !f.dyadic.is_empty();
    let count = frames.iter().filter(|f| fell_back(f)).count();
    assert_eq!(count as u64, 4 * stats.fallback_blocks, "its frames tell whom the joints follow");
    let last = frames.last().unwrap();
    assert_eq!((last.held, last.sampler, fell_back(last)), (0.0, Sampler::Midpoint4, false), "and back");
    // Held but in the cross-fades, a frame and eight after each switch.
    let mut since = usize::MAX / 2;
    for pair in frames.windows(2) {
        since = if fell_back(&pair[0]) == fell_back(&pair[1]) { since + 1 } else { 0 };
        assert_eq!(pair[1].held > 0.0, since < 9, "frame {}, {since} after a switch", pair[1].index);
    }
    // Where it is switched no joint is half as fast, nor changes its velocity half as much, as
    // elsewhere at most.
    let place = |frame: usize, j: usize| frames[frame].global[j].position;
    let (mut switches, mut at, mut elsewhere) = (0, [0.0_f32; 2], [0.0_f32; 2]);
    for i in 1..frames.len() - 1 {
        let switched = fell_back(&frames[i - 1]) != fell_back(&frames[i]);
        switches += usize::from(switched);
        let most = if switched { &mut at } else { &mut elsewhere };
        for j in 0..frames[i].global.len() {
            let (before, after) = (place(i, j) - place(i - 1, j), place(i + 1, j) - place(i, j));
            most[0] = most[0].max(before.length());
            most[1] = most[1].max((after - before).length());
        }
    }
    assert!(switches >= 2 && [0, 1].iter().all(|c| 2.0 * at[*c] < elsewhere[*c]), "{switches}, {at:?}, {elsewhere:?}");

    // Replayed without a clock, and after a reset, it is the same.
    let governor = Governor::Replay(session.decisions().collect::<Vec<_>>().into());
    session.set_governor(governor).unwrap();
    session.reset().unwrap();
    assert_eq!(run(&mut session, &inputs, 901), frames);
}

/// A fallback that is late as well is given up, and tried again after rehearsals.
#[test]
fn a_late_fallback_gives_way_to_a_held_pose() {
    let mut session = with_fallback(&tiny());
    let mut frames = Vec::new();
    for block in 0..300 {
        frames.extend(poll_blocks(&mut session, 1));
        let late = (60..200).contains(&block) && session.decisions().last().unwrap().plan.hold != Hold::Yes;
        session.report_block_time(if late { 150.0 } else { 5.0 }).unwrap();
    }
    let stats = session.stats().governor;
    assert!(stats.held_blocks > 80 && (3..30).contains(&stats.fallback_blocks), "{stats:?}");
    assert!(frames.iter().flat_map(|f| &f.global).all(|t| t.position.is_finite()));
    assert_eq!(frames.last().map(|f| f.held), Some(0.0));
}

/// A fallback that is never needed changes nothing; one that does not fit is refused.
#[test]
fn a_fallback_is_for_need_alone_and_must_fit() {
    let inputs = Inputs::circling(common::block_seconds(40), 24_000);
    let engine = tiny();
    let plain = SessionOptions { governor: Governor::Off, ..options() };
    let mut session = engine.session(plain.clone()).unwrap();
    session.set_fallback(&dram("lstm")).unwrap();
    assert_eq!(run(&mut session, &inputs, 40), run(&mut engine.session(plain).unwrap(), &inputs, 40));
    assert_eq!(session.set_fallback(&engine).unwrap_err().kind(), ErrorKind::Argument);
    let mut light = dram("lstm").session(SessionOptions::default()).unwrap();
    assert_eq!(light.set_fallback(&dram("tcn")).unwrap_err().kind(), ErrorKind::Argument);
}
