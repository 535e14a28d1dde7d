//! What a session promises to those who push into it from other threads: they never wait, nothing
//! that is in time is lost, and the motion is that of the same inputs pushed in one thread.

mod common;

use common::{Inputs, poll_blocks, run, tiny};
use glam::Vec3;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::{Acquire, Release};
use visavis::{ErrorKind, FPS, Sampler, Session, SessionOptions, SharedSession, Speaker};

const BLOCKS: usize = 30;

fn options() -> SessionOptions {
    SessionOptions { gaze: Some(0.8), ..Default::default() }
}

fn inputs(rate: u32) -> Inputs {
    Inputs::circling(common::block_seconds(BLOCKS), rate)
}

fn session() -> Session {
    tiny().session(options()).unwrap()
}

/// Voices in pieces, each by a thread of its own, and the head by three, all before the first
/// block.
#[test]
fn who_pushes_what_does_not_change_a_bit() {
    let inputs = inputs(44_100);
    let whole = run(&mut session(), &inputs, BLOCKS);
    for piece in [1_000, 77] {
        let mut session = session();
        std::thread::scope(|scope| {
            for (speaker, sound) in [(Speaker::Agent, &inputs.agent), (Speaker::User, &inputs.user)] {
                let input = session.voice_input(speaker);
                scope.spawn(move || sound.chunks(piece).for_each(|s| input.push(s, 44_100).unwrap()));
            }
            for thread in 0..3 {
                let (head, path) = (session.head_input(), &inputs.path);
                scope.spawn(move || path.iter().skip(thread).step_by(3).for_each(|(t, p)| head.push(*p, *t)));
            }
        });
        assert_eq!(poll_blocks(&mut session, BLOCKS), whole, "pieces of {piece}");
        let stats = session.stats().inputs;
        assert_eq!((stats.head.accepted, stats.head.out_of_order), (inputs.path.len() as u64, 0));
        assert_eq!((stats.agent_voice.contended_samples, stats.agent_voice.overflow_samples), (0, 0));
    }
}

/// Threads push while blocks are computed, each block's inputs before its poll and the rest
/// whenever they like.
#[test]
fn when_it_is_pushed_does_not_change_a_bit() {
    let inputs = inputs(24_000);
    let whole = run(&mut session(), &inputs, BLOCKS);
    let mut session = session();
    let done = [const { AtomicUsize::new(0) }; 3];
    let mut frames = Vec::new();
    std::thread::scope(|scope| {
        for (speaker, sound, done) in
            [(Speaker::Agent, &inputs.agent, &done[0]), (Speaker::User, &inputs.user, &done[1])]
        {
            let input = session.voice_input(speaker);
            scope.spawn(move || {
                for piece in sound.chunks(333) {
                    input.push(piece, 24_000).unwrap();
                    done.fetch_add(piece.len(), Release);
                    std::thread::yield_now();
                }
            });
        }
        let (head, path, walked) = (session.head_input(), &inputs.path, &done[2]);
        scope.spawn(move || {
            for (time, position) in path {
                head.push(*position, *time);
                walked.fetch_add(1, Release);
                std::thread::yield_now();
            }
        });
        for block in 0..BLOCKS {
            let sound = (3_200 * (block + 1)).min(inputs.agent.len());
            let heads = inputs.path.iter().filter(|(time, _)| *time <= common::block_seconds(block)).count();
            while done[..2].iter().any(|done| done.load(Acquire) < sound) || done[2].load(Acquire) < heads {
                std::thread::yield_now();
            }
            frames.extend_from_slice(session.poll(common::block_seconds(block)).unwrap().unwrap());
        }
    });
    assert_eq!(frames, whole);
}

/// With the session in another thread's hands all pushes and settings come back: one that waited
/// would never.
#[test]
fn nobody_waits_for_who_has_the_session() {
    let shared = SharedSession::new(session());
    let mut held = shared.lock().unwrap();
    std::thread::scope(|scope| {
        scope
            .spawn(|| {
                for speaker in [Speaker::Agent, Speaker::User] {
                    let voice = shared.voice(speaker);
                    voice.push(&[0.1; 4_800], 48_000).unwrap();
                    voice.finish();
                    voice.clear();
                    voice.set_present(true);
                    voice.push(&[0.1; 480], 24_000).unwrap();
                }
                shared.head().push(Vec3::new(0.0, 1.6, 2.0), 0.0);
                let controls = shared.controls();
                controls.set_gaze(None).unwrap();
                controls.set_guidance(1.0, 1.0).unwrap();
                controls.set_sampler(Sampler::Single).unwrap();
                controls.set_budget(50.0).unwrap();
                controls.set_budget(0.0).unwrap();
                controls.report_block_time(1.0).unwrap();
                assert!(shared.try_lock().is_err() && !shared.is_poisoned());
            })
            .join()
            .unwrap();
    });
    assert_eq!((held.sampler(), held.options().sampler), (Sampler::Single, Sampler::Midpoint4));
    assert_eq!(held.poll(0.0).unwrap().unwrap()[0].sampler, Sampler::Single);
    let options = held.options();
    assert_eq!((options.gaze, options.guidance, options.gaze_guidance), (None, Some(1.0), Some(1.0)));
    let stats = held.stats().inputs;
    assert_eq!((stats.head.accepted, stats.agent_voice.underrun_samples), (1, 3_200 - 480));
}

#[test]
fn settings_from_elsewhere_are_those_of_the_session() {
    let inputs = inputs(24_000);
    let (mut here, mut there) = (session(), session());
    let controls = there.controls();
    let (a, b) = (run(&mut here, &inputs, 4), run(&mut there, &inputs, 4));
    assert_eq!(a, b);
    here.set_gaze(Some(-0.5)).unwrap();
    here.set_guidance(1.7, 3.0).unwrap();
    here.set_sampler(Sampler::Midpoint2).unwrap();
    // The last one counts; what the session's owner sets comes after what was set before.
    controls.set_gaze(Some(0.3)).unwrap();
    controls.set_gaze(Some(-0.5)).unwrap();
    controls.set_guidance(1.7, 3.0).unwrap();
    controls.set_sampler(Sampler::Single).unwrap();
    there.set_sampler(Sampler::Midpoint2).unwrap();
    assert_eq!(poll_blocks(&mut there, 6), poll_blocks(&mut here, 6));

    for e in [
        controls.set_gaze(Some(f32::NAN)).unwrap_err(),
        controls.set_guidance(-1.0, 0.0).unwrap_err(),
        controls.set_sampler(Sampler::euler(5).unwrap()).unwrap_err(),
        controls.set_budget(0.5).unwrap_err(),
        controls.report_block_time(f64::INFINITY).unwrap_err(),
    ] {
        assert_eq!(e.kind(), ErrorKind::Argument);
    }
    assert_eq!(poll_blocks(&mut there, 2), poll_blocks(&mut here, 2));
}

/// Bad samples are silence, the good ones around them are heard; a bad rate takes nothing; both are
/// counted.
#[test]
fn bad_sound_is_an_error_that_keeps_what_was_good() {
    let (mut bad, mut good) = (session(), session());
    let mut sound = inputs(24_000).agent;
    sound.truncate(12_800);
    sound[700..720].fill(0.0);
    good.push_audio(Speaker::Agent, &sound, 24_000).unwrap();
    sound[700..720].fill(f32::NAN);
    assert_eq!(bad.push_audio(Speaker::Agent, &sound, 24_000).unwrap_err().kind(), ErrorKind::Audio);
    assert_eq!(bad.push_audio(Speaker::Agent, &sound, 7_999).unwrap_err().kind(), ErrorKind::Audio);
    assert_eq!(poll_blocks(&mut bad, 4), poll_blocks(&mut good, 4));
    let stats = bad.stats().inputs.agent_voice;
    assert_eq!((stats.non_finite_samples, stats.bad_rate_samples), (20, 12_800));
    for (number, speaker) in [(0, Some(Speaker::Agent)), (1, Some(Speaker::User)), (2, None), (-1, None)] {
        assert_eq!(Speaker::try_from(number).ok(), speaker);
    }
}

/// A minute may be pushed ahead, by one thread or in turns with commands; more is dropped and
/// counted.
#[test]
fn a_minute_is_kept() {
    let mut session = session();
    let input = session.voice_input(Speaker::Agent);
    let second = vec![0.05; 48_000];
    input.prepare(48_000).unwrap();
    let overflow = |session: &Session| session.stats().inputs.agent_voice.overflow_samples;
    (0..59).for_each(|_| input.push(&second, 48_000).unwrap());
    assert_eq!(overflow(&session), 0);
    (0..2).for_each(|_| input.push(&second, 48_000).unwrap());
    // But for the resampler's look-ahead.
    let over = overflow(&session);
    assert!((23_950..24_050).contains(&over), "{over}");
    input.clear();
    (0..30).for_each(|_| input.push(&second, 48_000).unwrap());
    assert_eq!(overflow(&session), over);
    let before = input.clone();
    poll_blocks(&mut session, 2);
    session.reset().unwrap();
    assert_eq!(session.stats().inputs.agent_voice, Default::default());
    // Handles outlive a reset.
    before.push(&second, 24_000).unwrap();
    poll_blocks(&mut session, 3);
    assert_eq!(session.stats().inputs.agent_voice.underrun_samples, 0);
}

/// Half a second is enough for sound that is pushed as it is heard, and changes no bit; what is
/// more is dropped and counted; less, or more than a minute, is refused.
#[test]
fn a_session_may_keep_less() {
    let inputs = inputs(24_000);
    let whole = run(&mut session(), &inputs, BLOCKS);
    let small = |voice_ahead| tiny().session(SessionOptions { voice_ahead, ..options() });
    let mut session = small(0.5).unwrap();
    inputs.path.iter().for_each(|(time, position)| session.push_user_head(*position, *time).unwrap());
    let mut frames = Vec::new();
    for block in 0..BLOCKS {
        let sound = 3200 * block..3200 * (block + 1);
        session.push_agent_audio(&inputs.agent[sound.clone()], 24_000).unwrap();
        session.push_user_audio(&inputs.user[sound], 24_000).unwrap();
        frames.extend(poll_blocks(&mut session, 1));
    }
    assert_eq!(frames, whole);
    assert_eq!(session.stats().inputs.user_voice.overflow_samples, 0);
    session.push_agent_audio(&[0.05; 24_000], 24_000).unwrap();
    assert_eq!(session.stats().inputs.agent_voice.overflow_samples, 12_000);
    for seconds in [0.0, 0.49, 60.1, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(small(seconds).unwrap_err().kind(), ErrorKind::Argument, "{seconds}");
    }
}

/// Positions come by two ways, one of them late: what no block has used is put in order, the rest
/// is counted.
#[test]
fn heads_are_put_in_order_until_they_are_used() {
    let inputs = inputs(24_000);
    let whole = run(&mut session(), &inputs, BLOCKS);
    let mut session = session();
    session.push_audio(Speaker::Agent, &inputs.agent, 24_000).unwrap();
    session.push_audio(Speaker::User, &inputs.user, 24_000).unwrap();
    let head = session.head_input();
    let mut frames = Vec::new();
    let mut path = inputs.path.iter().peekable();
    for block in 0..BLOCKS {
        let now = block as f64 * 4.0 / f64::from(FPS);
        let mut due: Vec<_> = std::iter::from_fn(|| path.next_if(|(time, _)| *time <= now)).collect();
        due.reverse();
        due.iter().for_each(|(time, position)| head.push(*position, *time));
        frames.extend_from_slice(session.poll(now).unwrap().unwrap());
    }
    assert_eq!(frames, whole);
    assert_eq!(session.stats().inputs.head.out_of_order, 0);
    // Used, one of them at the very time of another; then one that is not.
    [0.1, 1.0, inputs.path[3].0].iter().for_each(|time| head.push(Vec3::Y, *time));
    head.push(Vec3::Y, common::block_seconds(BLOCKS));
    session.poll(common::block_seconds(BLOCKS)).unwrap();
    assert_eq!(session.stats().inputs.head.out_of_order, 3);
}
