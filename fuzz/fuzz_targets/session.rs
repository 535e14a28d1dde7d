//! A caller that does anything in any order: sizes, rates, NaN, time that goes back, options that
//! change. Frames are finite and in order, errors are typed, nothing else happens.
#![no_main]

use arbitrary::{Arbitrary, Unstructured};
use glam::Vec3;
use libfuzzer_sys::fuzz_target;
use std::cell::RefCell;
use visavis::internals::session::{Anchoring, Diagnostics};
use visavis::{Budget, ErrorKind, Governor, Root, Sampler, Session, SessionOptions, Speaker};
use visavis_fuzz::{engine, light, student, tiny};

thread_local! {
    /// The sessions of most executions, by [`make`]: making one takes longer than using it, and a
    /// reset is to leave nothing behind. Others make their own.
    static KEPT: RefCell<[Option<Session>; 4]> = const { RefCell::new([const { None }; 4]) };
}

/// Blocks that an execution computes at most: many executions are worth more than long ones. With a
/// fallback as many as it takes to get there and back.
const BLOCKS: [u32; 2] = [3, 8];
/// The one with a fallback.
const FALLS_BACK: usize = 3;

#[derive(Debug, Arbitrary)]
struct Options {
    seed: u64,
    sampler: u8,
    gaze: Option<f32>,
    weights: Option<f32>,
    temperature: Option<f32>,
    start: [f64; 3],
    anchoring: u8,
    budget: Option<f32>,
    stance: bool,
    voice_ahead: Option<f64>,
    first_block: u32,
}

#[derive(Debug, Arbitrary)]
enum Step {
    /// Voice, length, rate, value.
    Sound(bool, u16, u32, f32),
    /// The same at a rate that is allowed.
    GoodSound(bool, u16, u8),
    Head([f32; 3], f64),
    GoodHead([i8; 3], u8),
    Poll(f64),
    Due,
    Gaze(Option<f32>),
    Guidance(f32, f32),
    Sampler(u8),
    Governor(Option<f32>),
    Time(f64),
    /// The last block was late, or in time.
    Late(bool),
    Present(bool, bool),
    Finish(bool),
    Clear(bool),
    /// A sound in the room: source, length, rate, value, place.
    Source(u8, u16, u32, f32, [f32; 3]),
    /// The same of a rate that is allowed, within some metres.
    GoodSource(u8, u16, u8, [i8; 3]),
    EndSource(u8),
    /// A host's ears: lengths, rate, values.
    Ears([u16; 2], u32, [f32; 2]),
    /// The same of one length and a rate that is allowed.
    GoodEars(u16, u8),
    EndEars,
    Sensitivity(f32),
    /// Settings by the way of other threads.
    Elsewhere(Option<f32>, f32, u8),
    Replay,
    Reset,
}

fn sampler(i: u8) -> Sampler {
    match i % 6 {
        0 => Sampler::Midpoint4,
        1 => Sampler::Midpoint1,
        // Mostly few steps.
        2 if i < 252 => Sampler::euler(1 + i / 6 % 4).expect("1 to 4 steps"),
        2 => Sampler::euler(i - 190).expect("62 steps and more"),
        3 => Sampler::Midpoint2,
        _ => Sampler::Single,
    }
}

fn governor(budget: Option<f32>) -> Governor {
    budget.map_or(Governor::Off, |milliseconds| Governor::Budget(Budget { milliseconds, coarse: milliseconds > 50.0 }))
}

/// A session that is kept: of the student alone (0), of the featherweight tier (1, 2), of the
/// student with such a fallback.
fn make(which: usize) -> Session {
    let engine = match which {
        1 | 2 => light(which == 2),
        FALLS_BACK => tiny(),
        _ => student(),
    };
    let options = SessionOptions { sampler: Sampler::Single, ..SessionOptions::default() };
    let mut session = engine.session(options).expect("a session");
    if which == FALLS_BACK {
        session.set_fallback(&light(false)).expect("the same rig");
    }
    session
}

fuzz_target!(|data: &[u8]| {
    let mut u = Unstructured::new(data);
    let first = u.arbitrary::<u8>().unwrap_or(u8::MAX);
    if first >= 48 {
        let which = match first {
            48..72 => 1,
            72..96 => 2,
            96..144 => FALLS_BACK,
            _ => 0,
        };
        return KEPT.with_borrow_mut(|kept| {
            let session = kept[which].get_or_insert_with(|| make(which));
            session.set_gaze(None).expect("no target");
            session.set_guidance(1.3, 2.5).expect("weights");
            session.set_sampler(Sampler::Single).expect("a student, or no samplers");
            session.set_governor(governor((which == FALLS_BACK).then_some(60.0))).expect("none, or a budget");
            session.reset().expect("a reset");
            drive(session, &mut u, BLOCKS[usize::from(which == FALLS_BACK)]);
        });
    }
    let Ok(o) = Options::arbitrary(&mut u) else { return };
    let options = SessionOptions {
        seed: o.seed,
        sampler: sampler(o.sampler),
        gaze: o.gaze,
        guidance: o.weights,
        temperature: o.temperature,
        start: Root { x: o.start[0], z: o.start[1], yaw: o.start[2] },
        governor: governor(o.budget),
        stance: o.stance,
        voice_ahead: o.voice_ahead.unwrap_or(0.5),
        diagnostics: Diagnostics {
            anchoring: if o.anchoring == 0 { Anchoring::Bundle } else { Anchoring::Every(u32::from(o.anchoring) - 1) },
            first_block: u64::from(o.first_block),
            ..Diagnostics::default()
        },
        ..SessionOptions::default()
    };
    let engine = if first < 32 { engine() } else { light(first % 2 == 1) };
    let mut session = match engine.session(options) {
        Ok(session) => session,
        Err(e) => return assert_eq!(e.kind(), ErrorKind::Argument, "{e}"),
    };
    drive(&mut session, &mut u, BLOCKS[0]);
});

/// Takes steps while there are any, and as many blocks at most.
fn drive(session: &mut Session, u: &mut Unstructured, most: u32) {
    let (mut next, mut blocks) = (None, 0);
    while let Ok(step) = Step::arbitrary(u) {
        if blocks >= most || u.is_empty() {
            break;
        }
        blocks += take(session, step, &mut next);
    }
}

/// Takes a step; returns the number of blocks that were computed.
fn take(session: &mut Session, step: Step, next: &mut Option<u64>) -> u32 {
    let mut sound = [0.0f32; 4096];
    let typed = |result: visavis::Result<()>| {
        if let Err(e) = result {
            assert!(matches!(e.kind(), ErrorKind::Argument | ErrorKind::Audio), "{e}");
        }
    };
    let speaker = |agent| if agent { Speaker::Agent } else { Speaker::User };
    let push = |session: &mut Session, agent, samples: &[f32], rate| session.push_audio(speaker(agent), samples, rate);
    match step {
        Step::Sound(agent, len, rate, value) => {
            sound.fill(value);
            typed(push(session, agent, &sound[..usize::from(len) % sound.len()], rate));
        }
        Step::GoodSound(agent, len, i) => {
            // Mostly 24 kHz: making a resampler takes longer than all the rest.
            let rate = [24_000, 48_000, 8_000, 192_000][usize::from(i.saturating_sub(250)) % 4];
            sound.iter_mut().enumerate().for_each(|(i, s)| *s = (i as f32 * 0.1).sin());
            push(session, agent, &sound[..usize::from(len) % sound.len()], rate).expect("a good sound");
        }
        Step::Source(id, len, rate, value, place) => {
            sound.fill(value);
            let samples = &sound[..usize::from(len) % sound.len()];
            typed(session.push_sound(u32::from(id), samples, rate, Vec3::from(place)));
        }
        Step::GoodSource(id, len, i, place) => {
            let rate = [24_000, 48_000, 8_000, 192_000][usize::from(i.saturating_sub(250)) % 4];
            sound.iter_mut().enumerate().for_each(|(i, s)| *s = 60.0 * (i as f32 * 0.1).sin());
            let samples = &sound[..usize::from(len) % sound.len()];
            let place = Vec3::from(place.map(f32::from)) / 20.0;
            let (sounds, hears) = (session.sounds(), session.sounds().is_heard());
            let pushed = sounds.push(u32::from(id), samples, rate, place);
            assert_eq!(pushed.is_ok(), hears, "a good sound");
        }
        Step::EndSource(id) => {
            let hears = session.sounds().is_heard();
            assert_eq!(session.end_sound(u32::from(id)).is_ok(), hears, "a source or none");
        }
        Step::Ears(lengths, rate, values) => {
            let ears = [0, 1].map(|side| vec![values[side]; usize::from(lengths[side]) % 4096]);
            typed(session.push_ears(&ears[0], &ears[1], rate));
        }
        Step::GoodEars(len, i) => {
            let rate = [24_000, 48_000, 8_000, 192_000][usize::from(i.saturating_sub(250)) % 4];
            sound.iter_mut().enumerate().for_each(|(i, s)| *s = 60.0 * (i as f32 * 0.1).sin());
            let samples = &sound[..usize::from(len) % sound.len()];
            let hears = session.sounds().is_heard();
            assert_eq!(session.push_ears(samples, samples, rate).is_ok(), hears, "good ears");
        }
        Step::EndEars => assert_eq!(session.end_ears().is_ok(), session.sounds().is_heard(), "ears or none"),
        Step::Sensitivity(sensitivity) => typed(session.set_sensitivity(sensitivity)),
        Step::Head(p, time) => typed(session.push_user_head(Vec3::from(p), time)),
        Step::GoodHead(p, later) => {
            let time = session.next_due() + f64::from(later) / 100.0;
            typed(session.push_user_head(Vec3::from(p.map(f32::from)) / 20.0, time));
        }
        Step::Poll(now) => return poll(session, now, next),
        Step::Due => return poll(session, session.next_due(), next),
        Step::Gaze(target) => typed(session.set_gaze(target)),
        Step::Guidance(weight, gaze) => typed(session.set_guidance(weight, gaze)),
        Step::Sampler(i) => typed(session.set_sampler(sampler(i))),
        Step::Governor(budget) => typed(session.set_governor(governor(budget))),
        Step::Time(ms) => typed(session.report_block_time(ms)),
        Step::Late(late) => typed(session.report_block_time(if late { 1e5 } else { 1.0 })),
        Step::Present(agent, present) => {
            session.voice_input(speaker(agent)).set_present(present);
        }
        Step::Finish(agent) => session.voice_input(speaker(agent)).finish(),
        Step::Clear(agent) => session.voice_input(speaker(agent)).clear(),
        Step::Elsewhere(gaze, budget, i) => {
            let controls = session.controls();
            typed(controls.set_gaze(gaze));
            typed(controls.set_guidance(budget, gaze.unwrap_or(1.0)));
            typed(controls.set_sampler(sampler(i)));
            typed(controls.set_budget(budget));
            typed(controls.report_block_time(f64::from(budget)));
        }
        Step::Replay => {
            let decisions: Vec<_> = session.decisions().collect();
            typed(session.set_governor(Governor::Replay(decisions.into())));
        }
        Step::Reset => {
            session.reset().expect("a reset");
            *next = None;
        }
    }
    0
}

fn poll(session: &mut Session, now: f64, next: &mut Option<u64>) -> u32 {
    match session.poll(now) {
        Ok(None) => 0,
        Ok(Some(frames)) => {
            for frame in frames {
                assert!(frame.dyadic.iter().all(|share| (0.0..=1.0).contains(share)));
                assert!(next.is_none_or(|n| n == frame.index));
                *next = Some(frame.index + 1);
                assert!(frame.global.iter().all(|t| t.position.is_finite() && t.rotation.is_finite()));
                assert!(frame.local.iter().all(|q| q.is_finite()) && frame.hips.is_finite());
            }
            let place = session.heard_place();
            assert!(place.is_none_or(|place| place.is_finite() && session.sounds().is_heard()), "{place:?}");
            1
        }
        Err(e) => {
            assert!(matches!(e.kind(), ErrorKind::Argument | ErrorKind::State), "{e}");
            0
        }
    }
}
