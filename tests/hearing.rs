//! Sounds in the room: what is heard of them is what two ears at the agent's head would hear, the
//! same bits however they were brought, bounded whatever comes, and nothing at all before the
//! first.

mod common;

use common::{
    HEARING, Inputs, TOLD, guided_hearing_bytes, hearing, hearing_in, motion_of, noise, poll_blocks, run, tiny,
};
use glam::Vec3;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;
use visavis::internals::audio::{AudioEncoder, AudioWeights};
use visavis::internals::bundle::AudioSource;
use visavis::internals::frame::{BLOCK_SAMPLES, FRAME_SAMPLES};
use visavis::internals::kernels::{Exec, Kernels, Scheme};
use visavis::internals::session::Probe;
use visavis::{Budget, BundleFile, Engine, ErrorKind, Frame, Governor, Session, SessionOptions, Transform};

const RATE: u32 = 24_000;
const BLOCKS: usize = 24;

/// Stages of hearing, by block.
#[derive(Default)]
struct Stages(BTreeMap<(u64, &'static str), Vec<f32>>);

impl Probe for Stages {
    fn stage(&mut self, block: u64, name: &'static str, values: &[f32]) {
        if name.starts_with("hearing.") || name == "conditioning.sound" {
            self.0.insert((block, name), values.to_vec());
        }
    }
}

impl Stages {
    fn vector(&self, block: usize) -> Option<&[f32]> {
        self.0.get(&(block as u64, "conditioning.sound")).map(Vec::as_slice)
    }

    /// Levels of four frames at the left and the right ear.
    fn levels(&self, block: usize) -> [[f32; 2]; 4] {
        let at = 4 * TOLD;
        let levels = &self.vector(block).expect("something is heard")[at..at + 8];
        std::array::from_fn(|t| [levels[2 * t], levels[2 * t + 1]])
    }

    /// Known, sine, cosine, distance, height.
    fn place(&self, block: usize) -> [f32; 5] {
        let at = 4 * TOLD + 8;
        self.vector(block).expect("something is heard")[at..at + 5].try_into().expect("five values")
    }

    fn is_known(&self, block: usize) -> bool {
        self.vector(block).is_some_and(|vector| vector[4 * TOLD + 8] == 1.0)
    }
}

/// Polls a block.
fn block(session: &mut Session, stages: &mut Stages) -> Vec<Frame> {
    let now = session.next_due();
    session.poll_with(now, Some(stages)).expect("poll").expect("a block is due").to_vec()
}

fn session(engine: &Arc<Engine>) -> Session {
    engine.session(SessionOptions::default()).expect("a session")
}

/// What sounds: id, the block before whose poll it is pushed, sound, place.
type Sound = (u32, usize, Vec<f32>, Vec3);

fn sounds() -> Vec<Sound> {
    vec![
        (7, 3, noise(1, 9_100, 0.4), Vec3::new(2.0, 0.5, -3.0)),
        (2, 3, noise(2, 20_000, 0.05), Vec3::new(-0.4, 1.7, 0.3)),
        (9, 8, noise(3, 3_200, 2.0), Vec3::new(0.0, 1.2, 5.0)),
        (7, 14, noise(4, 6_400, 0.3), Vec3::new(-4.0, 2.5, -1.0)),
    ]
}

fn push_due(session: &mut Session, sounds: &[Sound], block: usize) {
    for (id, _, samples, place) in sounds.iter().filter(|sound| sound.1 == block) {
        session.push_sound(*id, samples, RATE, *place).expect("a good sound");
    }
}

fn play(session: &mut Session, sounds: &[Sound]) -> (Vec<Frame>, Stages) {
    let (mut frames, mut stages) = (Vec::new(), Stages::default());
    for i in 0..BLOCKS {
        push_due(session, sounds, i);
        frames.extend(block(session, &mut stages));
    }
    (frames, stages)
}

#[test]
fn nothing_changes_before_the_first_sound() {
    let inputs = Inputs::circling(4.0, RATE);
    let options = || SessionOptions { sensitivity: 1.0, gaze: Some(0.6), ..Default::default() };
    let deaf = motion_of(&tiny(), options(), &inputs, BLOCKS);
    assert_eq!(motion_of(&hearing(), options(), &inputs, BLOCKS), deaf);

    let mut session = hearing().session(options()).unwrap();
    let mut frames = run(&mut session, &inputs, 10);
    session.push_sound(1, &noise(1, 4_800, 0.5), RATE, Vec3::new(1.0, 1.0, -1.0)).unwrap();
    frames.extend(poll_blocks(&mut session, BLOCKS - 10));
    assert_eq!(frames[..44], deaf[..44]);
    assert_ne!(frames[44..], deaf[44..], "it answers");
    // Nothing of it is left after a reset.
    session.reset().unwrap();
    assert_eq!(run(&mut session, &inputs, BLOCKS), deaf);
}

#[test]
fn a_bundle_without_hearing_says_so() {
    let mut session = session(&tiny());
    assert!(!session.sounds().is_heard() && !session.engine().has_hearing() && hearing().has_hearing());
    let e = session.push_sound(1, &[0.1; 100], RATE, Vec3::ZERO).unwrap_err();
    assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("hearing"), "{e}");
    assert_eq!(session.end_sound(1).unwrap_err().kind(), ErrorKind::Argument);
    assert_eq!(session.stats().inputs.sounds, Default::default());
}

/// What two ears hear, computed on whole clips in f64.
struct Reference {
    ears: [Vec<f64>; 2],
    /// Of each source in each frame.
    salience: BTreeMap<u32, Vec<f64>>,
}

impl Reference {
    fn new(frames: usize) -> Self {
        Self { ears: [(); 2].map(|()| vec![0.0; frames * FRAME_SAMPLES]), salience: BTreeMap::new() }
    }

    /// A source that begins with frame `first`.
    fn add(&mut self, id: u32, first: usize, samples: &[f32], place: Vec3, heads: &[Transform], eyes: f32) {
        const Q: f64 = 24_000.0 * 0.0875 / 343.0;
        let length = self.ears[0].len();
        let mut sound = vec![0.0; length];
        let places = sound[first * FRAME_SAMPLES..].iter_mut();
        places.zip(samples).for_each(|(to, s)| *to = f64::from(*s));
        let heard: Vec<_> = heads
            .iter()
            .map(|head| {
                let centre = (head.position + head.rotation * Vec3::new(0.0, eyes, 0.0)).as_dvec3();
                let d = place.as_dvec3() - centre;
                let r = d.length();
                let left = (head.rotation * Vec3::X).as_dvec3().dot(d / r).clamp(-1.0, 1.0);
                [left, -left].map(|cosine| {
                    let angle = cosine.acos();
                    let around = if angle < FRAC_PI_2 { -angle.cos() } else { angle - FRAC_PI_2 };
                    let high = 1.05 + 0.95 * (angle / (150.0 * PI / 180.0) * PI).cos();
                    (0.0875 * (1.0 + around) / 343.0 * 24_000.0, high, 1.0 / r.max(0.3))
                })
            })
            .collect();
        for (ear, out) in self.ears.iter_mut().enumerate() {
            let (mut x1, mut y1) = (0.0, 0.0);
            for (n, out) in out.iter_mut().enumerate().take(length).skip(first * FRAME_SAMPLES) {
                let (t, w) = (n / FRAME_SAMPLES, (n % FRAME_SAMPLES + 1) as f64 / FRAME_SAMPLES as f64);
                let (now, before) = (heard[t][ear], heard[if t > first { t - 1 } else { t }][ear]);
                let mix = |a: f64, b: f64| a + (b - a) * w;
                let (delay, a, gain) = (mix(before.0, now.0), mix(before.1, now.1), mix(before.2, now.2));
                let at = n as f64 - delay;
                // Before its beginning there is nothing.
                let tap = |i: f64| if i < 0.0 { 0.0 } else { sound.get(i as usize).copied().unwrap_or(0.0) };
                let x = tap(at.floor()) * (1.0 - (at - at.floor())) + tap(at.floor() + 1.0) * (at - at.floor());
                let y = ((1.0 + a * Q) * x + (1.0 - a * Q) * x1 - (1.0 - Q) * y1) / (1.0 + Q);
                *out += y * gain;
                (x1, y1) = (x, y);
            }
        }
        let all = self.salience.entry(id).or_insert_with(|| vec![f64::NEG_INFINITY; heads.len()]);
        for t in first..heads.len() {
            let frame = &sound[t * FRAME_SAMPLES..][..FRAME_SAMPLES];
            let power = frame.iter().map(|s| s * s).sum::<f64>() / FRAME_SAMPLES as f64;
            let loud = 10.0 * (power + 1e-7).log10() + 94.0 + 20.0 * heard[t][0].2.log10();
            let before = if t > 0 { all[t - 1] } else { f64::NEG_INFINITY };
            all[t] = all[t].max(loud).max(before - 1.5);
        }
    }

    fn level(&self, frame: usize, ear: usize) -> f64 {
        let samples = &self.ears[ear][frame * FRAME_SAMPLES..][..FRAME_SAMPLES];
        let power = samples.iter().map(|s| s * s).sum::<f64>() / FRAME_SAMPLES as f64;
        ((10.0 * (power + 1e-7).log10() + 34.0) / 20.0).clamp(-2.0, 3.5)
    }
}

fn close(a: f32, b: f64, within: f64) -> bool {
    (f64::from(a) - b).abs() < within
}

#[test]
fn what_is_heard_is_what_two_ears_would_hear() {
    let engine = hearing();
    let mut session = session(&engine);
    let (frames, stages) = play(&mut session, &sounds());
    let head = engine.rig().index("head").unwrap();
    let heads: Vec<_> = frames.iter().map(|frame| frame.global[head]).collect();
    let mut reference = Reference::new(frames.len());
    let mut places = BTreeMap::new();
    for (id, block, samples, place) in sounds() {
        reference.add(id, 4 * block, &samples, place, &heads, engine.rig().eyes[1]);
        places.insert((id, block), place);
    }

    let kernels = Kernels::detect().unwrap();
    let config = engine.config().hearing.clone().unwrap();
    let bytes = common::hearing_bytes();
    let file = BundleFile::from_slice(&bytes, "tiny with hearing");
    let (_, tensors) = file.parse().unwrap();
    let weights: AudioWeights =
        AudioSource::load(&tensors, &config.audio, "hearing").unwrap().pack(kernels, &config.audio).unwrap();
    let mut encoder = AudioEncoder::new(&config.audio).unwrap();
    let mut exec = Exec::new(kernels, 1, AudioEncoder::width(&config.audio)).unwrap();

    assert!((0..4).all(|block| stages.vector(block).is_none()), "absent until something has sounded");
    // The encoder has heard silence before.
    let mut silence = vec![0.0; 16 * HEARING.0];
    encoder.encode(&mut exec, &weights, &[0.0; 16 * FRAME_SAMPLES], &mut silence);
    let mut known = 0;
    for block in 4..BLOCKS {
        // What was heard in the block before.
        for (t, levels) in stages.levels(block).into_iter().enumerate() {
            for (ear, level) in levels.into_iter().enumerate() {
                let want = reference.level(4 * (block - 1) + t, ear);
                assert!(close(level, want, 2e-4), "block {block}, frame {t}, ear {ear}: {level}, not {want}");
            }
        }
        let [left, right] = &reference.ears;
        let at = (block - 1) * BLOCK_SAMPLES;
        let mixed: Vec<_> = left[at..at + BLOCK_SAMPLES]
            .iter()
            .zip(&right[at..])
            .map(|(l, r)| {
                let m = 0.5 * (l + r);
                (m / (0.2 + m.abs())) as f32
            })
            .collect();
        let mut features = vec![0.0; 4 * HEARING.0];
        encoder.encode(&mut exec, &weights, &mixed, &mut features);
        let error = common::max_error(&features, &stages.0[&(block as u64, "hearing.features")]);
        assert!(error < 1e-4, "block {block}: {error}");
        let told = stages.vector(block).unwrap()[..4 * TOLD].chunks_exact(TOLD);
        for (told, features) in told.zip(stages.0[&(block as u64, "hearing.features")].chunks_exact(HEARING.0)) {
            let (first, shares) = told.split_at(HEARING.0);
            assert_eq!(first, features);
            let sum: f32 = shares.iter().sum();
            assert!(shares.iter().all(|share| (0.0..1.0).contains(share)) && (sum - 1.0).abs() < 1e-6, "{shares:?}");
        }

        // The first of the largest, by the order in which they began, in the last frame in which
        // one was loud enough.
        let most = |frame: usize| {
            let loud = |id| (id, reference.salience.get(&id).map_or(f64::NEG_INFINITY, |s| s[frame]));
            [2, 7, 9].into_iter().map(loud).reduce(|a, b| if b.1 > a.1 { b } else { a }).unwrap()
        };
        let last = 4 * block - 1;
        let place = stages.place(block);
        let Some(frame) = (last.saturating_sub(60)..=last).rev().find(|frame| most(*frame).1 >= 35.0) else {
            assert_eq!(place, [0.0; 5], "block {block}");
            continue;
        };
        known += 1;
        let id = most(frame).0;
        let began = places.keys().filter(|(i, from)| *i == id && *from <= frame / 4).map(|key| key.1).max().unwrap();
        let local = frames[last].root.to_local(places[&(id, began)]).as_dvec3();
        let rho = local.x.hypot(local.z);
        let want = [1.0, local.x / rho, local.z / rho, rho.max(0.3).log2() - 1.0, local.y - 1.5];
        for (got, want) in place.into_iter().zip(want) {
            assert!(close(got, want, 1e-5), "block {block}: {place:?}, not {want:?}");
        }
    }
    assert!(known == BLOCKS - 4, "{known}");
    let stats = session.stats().inputs.sounds;
    assert_eq!((stats.pieces, stats.started, stats.refused, stats.replaced), (4, 4, 0, 0));
}

#[test]
fn how_sounds_are_brought_does_not_change_a_bit() {
    let engine = hearing();
    let (whole, _) = play(&mut session(&engine), &sounds());
    for (piece, rate, threads) in [(977, RATE, 1), (64, RATE, 2), (2_500, 44_100, 1)] {
        let at_rate = |session: &mut Session, cut: bool| {
            let mut frames = Vec::new();
            for i in 0..BLOCKS {
                for (id, _, samples, place) in sounds().iter().filter(|sound| sound.1 == i) {
                    let input = session.sounds();
                    let pieces = samples.chunks(if cut { piece } else { samples.len() });
                    if cut {
                        // A thread for each source, one after the other or at once.
                        std::thread::scope(|scope| {
                            scope.spawn(move || pieces.for_each(|piece| input.push(*id, piece, rate, *place).unwrap()));
                        });
                    } else {
                        pieces.for_each(|piece| input.push(*id, piece, rate, *place).unwrap());
                    }
                }
                frames.extend(poll_blocks(session, 1));
            }
            frames
        };
        let options = SessionOptions { threads, ..Default::default() };
        let cut = at_rate(&mut engine.session(options).unwrap(), true);
        let want = if rate == RATE { whole.clone() } else { at_rate(&mut session(&engine), false) };
        assert_eq!(cut, want, "pieces of {piece} at {rate} Hz, {threads} threads");
    }
    // All sources at once, each from its own thread, in whatever order.
    let many: Vec<Sound> =
        (0..12).map(|id| (id, 2, noise(u64::from(id) + 1, 5_000, 0.2), Vec3::new(id as f32 - 6.0, 1.0, 2.0))).collect();
    let (one_by_one, _) = play(&mut session(&engine), &many);
    for round in 0..4 {
        let mut session = session(&engine);
        let mut frames = poll_blocks(&mut session, 2);
        std::thread::scope(|scope| {
            for (id, _, samples, place) in many.iter().skip(round).chain(&many[..round]).rev() {
                let input = session.sounds();
                scope
                    .spawn(move || samples.chunks(333).for_each(|piece| input.push(*id, piece, RATE, *place).unwrap()));
            }
        });
        frames.extend(poll_blocks(&mut session, BLOCKS - 2));
        assert_eq!(frames, one_by_one);
        let stats = session.stats().inputs.sounds;
        assert_eq!((stats.started, stats.contended_samples, stats.refused), (12, 0, 0));
    }
    // In a team, beside one that hears nothing.
    let mut team = engine.team(2).unwrap();
    let (mut a, mut b) = (session(&engine), session(&engine));
    let (mut heard, mut quiet) = (Vec::new(), Vec::new());
    for i in 0..BLOCKS {
        push_due(&mut a, &sounds(), i);
        let now = a.next_due();
        assert_eq!(team.step(&mut [(&mut a, now), (&mut b, now)]).unwrap(), 2);
        heard.extend_from_slice(a.frames().unwrap());
        quiet.extend_from_slice(b.frames().unwrap());
    }
    assert!(team.shared_blocks() > 0);
    assert_eq!(heard, whole);
    assert_eq!(quiet, poll_blocks(&mut session(&engine), BLOCKS));
}

#[test]
fn a_stream_that_is_pushed_as_it_is_heard_has_no_gaps() {
    for rate in [RATE, 48_000, 96_000] {
        let mut session = session(&hearing());
        let mut stages = Stages::default();
        let a_block = BLOCK_SAMPLES * (rate / RATE) as usize;
        let tone: Vec<f32> = (0..40 * a_block)
            .map(|i| 0.3 * libm::sinf(std::f32::consts::TAU * 440.0 * i as f32 / rate as f32))
            .collect();
        for (i, piece) in tone.chunks(a_block).enumerate() {
            session.push_sound(1, piece, rate, Vec3::new(1.0, 1.6, 2.0)).unwrap();
            block(&mut session, &mut stages);
            if i > 2 {
                let levels = stages.levels(i);
                assert!(levels.as_flattened().iter().all(|l| (l - levels[0][0]).abs() < 0.6), "{rate}: {levels:?}");
            }
        }
        assert_eq!(session.stats().inputs.sounds.started, 1, "{rate}");
    }
}

#[test]
fn a_click_at_any_rate_is_heard_and_the_next_one_too() {
    for rate in [RATE, 48_000, 192_000, 8_000] {
        let mut session = session(&hearing());
        let mut stages = Stages::default();
        for i in 0..40 {
            if matches!(i, 2 | 30) {
                // Half a millisecond.
                session.push_sound(5, &vec![20.0; rate as usize / 2_000], rate, Vec3::new(0.0, 1.6, 1.0)).unwrap();
            }
            block(&mut session, &mut stages);
        }
        for first in [2, 30] {
            let loud = (first + 1..first + 3).flat_map(|b| stages.levels(b)).flatten().fold(-2.0, f32::max);
            assert!(loud > 1.0, "{rate} Hz, block {first}: {loud}");
            assert!(stages.is_known(first + 2), "{rate} Hz");
        }
        assert!(stages.levels(28).as_flattened().iter().all(|level| *level < -1.7));
        assert_eq!(session.stats().inputs.sounds.started, 2);
    }
}

/// Whether what `block` is told to stand out is at `place`; the block before it made `frames`.
fn is_at(stages: &Stages, block: usize, frames: &[Frame], place: Vec3) -> bool {
    let local = frames[3].root.to_local(place);
    let rho = local.x.hypot(local.z);
    let [known, sin, cos, far, high] = stages.place(block);
    let wanted = [local.x / rho, local.z / rho, rho.log2() - 1.0, local.y - 1.5];
    known == 1.0 && [sin, cos, far, high].iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4)
}

#[test]
fn sounds_end_move_and_stand_out() {
    let mut session = session(&hearing());
    let mut stages = Stages::default();
    let (ahead, aside) = (Vec3::new(0.0, 1.6, 3.0), Vec3::new(3.0, 1.6, 0.0));
    session.push_sound(1, &noise(1, 10 * BLOCK_SAMPLES, 0.3), RATE, ahead).unwrap();
    let frames: Vec<_> = (0..4).map(|_| block(&mut session, &mut stages)).collect();
    let mut last = frames[2].clone();
    assert!(is_at(&stages, 3, &last, ahead), "{:?}", stages.place(3));
    // An empty piece moves it.
    session.push_sound(1, &[], RATE, aside).unwrap();
    for _ in 0..2 {
        last = session.frames().unwrap().to_vec();
        block(&mut session, &mut stages);
    }
    assert!(is_at(&stages, 5, &last, aside), "{:?}", stages.place(5));
    let head = last[3].global[session.engine().rig().index("head").unwrap()];
    let to_the_left = (head.rotation * Vec3::X).dot((aside - head.position).normalize());
    let [left, right] = stages.levels(5)[3];
    assert!((left - right) * to_the_left > 0.0 && to_the_left.abs() > 0.1, "{left} {right}, {to_the_left}");
    // A louder one takes over, and the place of what ended is remembered until it has faded.
    session.push_sound(2, &noise(2, 2 * BLOCK_SAMPLES, 3.0), RATE, ahead).unwrap();
    session.end_sound(1).unwrap();
    let frames: Vec<_> = (0..4).map(|_| block(&mut session, &mut stages)).collect();
    assert!(is_at(&stages, 7, &frames[0], ahead));
    // Nothing sounded in the block after the end.
    assert!(stages.levels(6).as_flattened().iter().all(|level| *level < -1.7), "{:?}", stages.levels(6));
    (0..60).for_each(|_| drop(block(&mut session, &mut stages)));
    assert!(!stages.is_known(69) && stages.vector(69).is_some(), "forgotten, but present");
    // From some 89 dB by 1.5 dB a frame to 35, and two seconds more.
    let forgotten = (8..70).find(|block| !stages.is_known(*block)).unwrap();
    assert!((8 + 8 + 15..8 + 11 + 15).contains(&forgotten), "{forgotten}");
    session.end_sound(77).unwrap();
}

#[test]
fn whatever_comes_is_bounded_typed_and_counted() {
    let engine = hearing();
    let mut session = session(&engine);
    let mut stages = Stages::default();
    let at = Vec3::new(1.0, 1.5, 1.0);
    let kind = |result: visavis::Result<()>| result.unwrap_err().kind();
    assert_eq!(kind(session.push_sound(1, &[0.1; 10], 7_999, at)), ErrorKind::Audio);
    assert_eq!(kind(session.push_sound(1, &[0.1; 10], RATE, Vec3::new(f32::NAN, 0.0, 0.0))), ErrorKind::Argument);
    assert_eq!(kind(session.push_sound(1, &[0.1; 10], RATE, Vec3::new(0.0, 3e6, 0.0))), ErrorKind::Argument);
    assert!(stages.0.is_empty());
    block(&mut session, &mut stages);
    assert_eq!(session.stats().inputs.sounds.started, 0, "a new source without a place is not heard");
    // The good part of what is bad is taken.
    let mut bad = noise(1, 4_800, 0.5);
    (bad[7], bad[9], bad[11]) = (f32::NAN, f32::NEG_INFINITY, 1e9);
    assert_eq!(kind(session.push_sound(1, &bad, RATE, at)), ErrorKind::Audio);
    assert_eq!(kind(session.push_sound(1, &bad[100..], RATE, Vec3::INFINITY)), ErrorKind::Argument);
    (0..4).for_each(|_| drop(block(&mut session, &mut stages)));
    assert!(stages.levels(4)[0][0] > 0.0, "the second piece too: {:?}", stages.levels(4));
    let stats = session.stats().inputs.sounds;
    assert_eq!((stats.pieces, stats.started, stats.bad_places, stats.bad_rate_samples), (2, 1, 3, 10));
    assert_eq!((stats.non_finite_samples, stats.clipped_samples), (2, 1));
    // Eleven seconds at once: ten are kept.
    session.push_sound(3, &vec![0.01; 11 * RATE as usize], RATE, at).unwrap();
    assert_eq!(session.stats().inputs.sounds.overflow_samples, u64::from(RATE));
    // A source in the middle of the head, and one at the end of the world.
    let head = session.frames().unwrap()[3].global[engine.rig().index("head").unwrap()];
    let centre = head.position + head.rotation * Vec3::new(0.0, engine.rig().eyes[1], 0.0);
    session.push_sound(4, &[64.0; 8_000], RATE, centre).unwrap();
    session.push_sound(5, &[64.0; 8_000], RATE, Vec3::splat(2e6)).unwrap();
    // Louder than anything, a hundred at once.
    for id in 100..200 {
        session.push_sound(id, &[if id % 2 == 0 { 64.0 } else { -1e30 }; 2_000], RATE, at * id as f32 / 100.0).unwrap();
    }
    for _ in 0..8 {
        let frames = block(&mut session, &mut stages);
        assert!(frames.iter().all(|f| f.global.iter().all(|t| t.position.is_finite() && t.rotation.is_finite())));
    }
    assert!(stages.0.values().flatten().all(|v| v.is_finite()));
    let stats = session.stats().inputs.sounds;
    assert!(stats.refused >= 70 && stats.started >= 16, "{stats:?}");
    assert_eq!(session.stats().inputs.sounds.pieces, 2 + 3 + 29, "32 sources in all are taken");
    session.reset().unwrap();
    assert_eq!(session.stats().inputs.sounds, Default::default());
}

#[test]
fn one_more_than_sixteen_is_heard_if_it_is_louder() {
    let engine = hearing();
    let mut session = session(&engine);
    let mut stages = Stages::default();
    let place = |i: u32| Vec3::new(3.0 * libm::sinf(i as f32), 1.6, 3.0 * libm::cosf(i as f32));
    for id in 0..16 {
        session
            .push_sound(id, &noise(u64::from(id) + 1, 10 * BLOCK_SAMPLES, 0.1 + 0.01 * id as f32), RATE, place(id))
            .unwrap();
    }
    (0..3).for_each(|_| drop(block(&mut session, &mut stages)));
    let counts = |session: &Session| {
        let stats = session.stats().inputs.sounds;
        (stats.started, stats.refused, stats.replaced)
    };
    assert_eq!(counts(&session), (16, 0, 0));
    session.push_sound(50, &noise(50, BLOCK_SAMPLES, 0.02), RATE, place(50)).unwrap();
    block(&mut session, &mut stages);
    assert_eq!(counts(&session), (16, 1, 0), "quieter than all");
    session.push_sound(51, &noise(51, BLOCK_SAMPLES, 5.0), RATE, place(51)).unwrap();
    let frames: Vec<_> = (0..2).map(|_| block(&mut session, &mut stages)).collect();
    assert_eq!(counts(&session), (17, 1, 1), "louder than the quietest");
    assert!(is_at(&stages, 5, &frames[0], place(51)));
    (0..12).for_each(|_| drop(block(&mut session, &mut stages)));
    assert!(stages.0.values().flatten().all(|v| v.is_finite()));
}

/// What an ear hears of noise, and the other one `later` samples later.
fn pair(samples: usize, later: usize, loud: f32) -> [Vec<f32>; 2] {
    let sound = noise(5, samples + later, loud);
    [sound[later..].to_vec(), sound[..samples].to_vec()]
}

/// The sine of the angle to the left of the plane between the agent's ears of a place.
fn to_the_left(session: &Session, frame: &Frame, place: Vec3) -> f32 {
    let head = frame.global[session.engine().rig().index("head").unwrap()];
    (head.rotation * Vec3::X).dot((place - head.position).with_y(0.0).normalize())
}

#[test]
fn ears_are_heard_and_say_from_where() {
    for swapped in [false, true] {
        let mut session = session(&hearing());
        let mut stages = Stages::default();
        assert_eq!(session.heard_place(), None);
        let mut ears = pair(8 * BLOCK_SAMPLES, 9, 0.3);
        if swapped {
            ears.reverse();
        }
        session.push_ears(&ears[0], &ears[1], RATE).unwrap();
        let mut last = block(&mut session, &mut stages);
        for i in 1..8 {
            let next = block(&mut session, &mut stages);
            let place = session.heard_place().expect("it stands out");
            let left = to_the_left(&session, &last[3], place);
            assert!(if swapped { left < -0.3 } else { left > 0.3 }, "block {i}: {left}");
            assert!(is_at(&stages, i, &last, place), "{place:?}, {:?}", stages.place(i));
            let level = stages.levels(i);
            assert!(level.as_flattened().iter().all(|level| (level - 1.0).abs() < 0.5), "{level:?}");
            last = next;
        }
        // A louder source stands out, then louder ears.
        let place = Vec3::new(0.5, 1.2, -1.0);
        session.push_sound(1, &noise(1, 4 * BLOCK_SAMPLES, 9.0), RATE, place).unwrap();
        (0..3).for_each(|_| drop(block(&mut session, &mut stages)));
        assert_eq!(session.heard_place(), Some(place));
        session.push_ears(&vec![50.0; BLOCK_SAMPLES], &vec![50.0; BLOCK_SAMPLES], RATE).unwrap();
        (0..3).for_each(|_| drop(block(&mut session, &mut stages)));
        assert!(session.heard_place().is_some_and(|other| other != place && other.y == 1.5));
        assert_eq!(session.stats().inputs.sounds.started, 3);
        session.reset().unwrap();
        assert_eq!((session.heard_place(), session.stats().inputs.sounds), (None, Default::default()));
    }
}

#[test]
fn how_ears_are_brought_does_not_change_a_bit() {
    let engine = hearing();
    let deaf = poll_blocks(&mut session(&tiny()), BLOCKS);
    for rate in [RATE, 44_100, 8_000, 192_000] {
        let [left, right] = pair(2 * rate as usize, 5, 0.3);
        let play = |piece: usize, threads: usize| {
            let options = SessionOptions { threads, ..Default::default() };
            let mut session = engine.session(options).unwrap();
            let mut frames = poll_blocks(&mut session, 4);
            for (left, right) in left.chunks(piece).zip(right.chunks(piece)) {
                session.push_ears(left, right, rate).unwrap();
            }
            session.push_ears(&[], &[], rate).unwrap();
            frames.extend(poll_blocks(&mut session, BLOCKS - 4));
            frames
        };
        let whole = play(left.len(), 1);
        assert_eq!(whole[..20], deaf[..20], "as without hearing, until then");
        assert_ne!(whole[20..], deaf[20..]);
        assert!(play(977, 1) == whole && play(64, 2) == whole, "{rate} Hz");
    }
}

#[test]
fn ears_that_are_pushed_as_they_hear_have_no_gaps() {
    for rate in [RATE, 48_000] {
        let mut session = session(&hearing());
        let mut stages = Stages::default();
        let a_block = BLOCK_SAMPLES * (rate / RATE) as usize;
        let tone: Vec<f32> = (0..30 * a_block).map(|i| 0.3 * libm::sinf(0.1 * i as f32)).collect();
        for (i, piece) in tone.chunks(a_block).enumerate() {
            session.push_ears(piece, piece, rate).unwrap();
            block(&mut session, &mut stages);
            if i > 2 {
                let levels = stages.levels(i);
                assert!(levels.as_flattened().iter().all(|l| (l - levels[0][0]).abs() < 0.3), "{rate}: {levels:?}");
            }
        }
        assert_eq!(session.stats().inputs.sounds.started, 1, "{rate}");
    }
}

#[test]
fn whatever_ears_bring_is_bounded_typed_and_counted() {
    let mut session = session(&hearing());
    let mut stages = Stages::default();
    let kind = |result: visavis::Result<()>| result.unwrap_err().kind();
    assert_eq!(kind(session.push_ears(&[0.1; 10], &[0.1; 9], RATE)), ErrorKind::Argument);
    assert_eq!(kind(session.push_ears(&[0.1; 10], &[], RATE)), ErrorKind::Argument);
    assert_eq!(kind(session.push_ears(&[0.1; 10], &[0.1; 10], 7_999)), ErrorKind::Audio);
    assert_eq!(kind(session.push_ears(&[0.1; 10], &[0.1; 10], 192_001)), ErrorKind::Audio);
    session.end_ears().unwrap();
    block(&mut session, &mut stages);
    assert!(session.stats().inputs.sounds.started == 0 && stages.0.is_empty(), "nothing was taken");
    let [mut left, right] = pair(4_800, 3, 0.5);
    (left[7], left[9], left[11]) = (f32::NAN, f32::NEG_INFINITY, 1e9);
    assert_eq!(kind(session.push_ears(&left, &right, RATE)), ErrorKind::Audio);
    (0..3).for_each(|_| drop(block(&mut session, &mut stages)));
    assert!(stages.levels(2)[0][1] > 0.5, "the rest was taken: {:?}", stages.levels(2));
    let stats = session.stats().inputs.sounds;
    assert_eq!((stats.pieces, stats.started, stats.bad_rate_samples), (1, 1, 40));
    assert_eq!((stats.non_finite_samples, stats.clipped_samples), (2, 1));
    // Eleven seconds at once: ten are kept, of both.
    let long = vec![0.2; 11 * RATE as usize];
    session.push_ears(&long, &long, RATE).unwrap();
    assert_eq!(session.stats().inputs.sounds.overflow_samples, 2 * u64::from(RATE));
    block(&mut session, &mut stages);
    session.end_ears().unwrap();
    (0..3).for_each(|_| drop(block(&mut session, &mut stages)));
    let last = *stages.0.keys().map(|(block, _)| block).max().unwrap() as usize;
    assert!(stages.levels(last).as_flattened().iter().all(|level| *level < -1.7), "nothing is left");
    for value in [64.0, -1e30, f32::MIN_POSITIVE, 1e-40] {
        session.push_ears(&[value; 9_000], &[-value; 9_000], RATE).unwrap();
        for _ in 0..4 {
            let frames = block(&mut session, &mut stages);
            assert!(frames.iter().all(|f| f.global.iter().all(|t| t.position.is_finite() && t.rotation.is_finite())));
        }
    }
    assert!(stages.0.values().flatten().all(|v| v.is_finite()));
    assert_eq!(kind(tiny().session(SessionOptions::default()).unwrap().push_ears(&[], &[], RATE)), ErrorKind::Argument);
}

#[test]
fn left_and_right_stay_together_whoever_pushes() {
    let mut session = session(&hearing());
    let mut stages = Stages::default();
    let ear = noise(3, 40_000, 0.4);
    std::thread::scope(|scope| {
        for rate in [RATE, 48_000] {
            let (input, ear) = (session.sounds(), &ear);
            scope.spawn(move || {
                for round in 0..60 {
                    ear.chunks(331).for_each(|piece| input.push_ears(piece, piece, rate).unwrap());
                    if round % 3 == 0 {
                        input.end_ears().unwrap();
                    }
                    std::thread::yield_now();
                }
            });
        }
        (0..60).for_each(|_| drop(block(&mut session, &mut stages)));
    });
    // The same samples in both: whatever was dropped, their levels are one.
    let vectors: Vec<_> =
        stages.0.keys().filter(|key| key.1 == "conditioning.sound").map(|key| key.0 as usize).collect();
    assert!(!vectors.is_empty());
    for i in vectors {
        assert!(stages.levels(i).iter().all(|[left, right]| left == right), "block {i}: {:?}", stages.levels(i));
    }
}

#[test]
fn blocks_that_are_held_hear_nothing_and_those_after_them_do() {
    let engine = hearing();
    let governor = Governor::Budget(Budget::default());
    let mut session = engine.session(SessionOptions { governor, ..Default::default() }).unwrap();
    let mut stages = Stages::default();
    let tone = noise(3, 60 * BLOCK_SAMPLES, 0.3);
    let mut late = 0;
    for (i, piece) in tone.chunks(BLOCK_SAMPLES).enumerate() {
        session.push_sound(1, piece, RATE, Vec3::new(1.0, 1.6, 2.0)).unwrap();
        let now = session.next_due();
        session.poll_with(now, Some(&mut stages)).unwrap().unwrap();
        session.report_block_time(if (10..30).contains(&i) { 150.0 } else { 0.1 }).unwrap();
        late += u64::from(stages.vector(i).is_none());
    }
    let held = session.stats().governor.held_blocks;
    // The first block has nothing.
    assert!(held > 5 && late == held + 1, "{held} held, {late} unheard");
    assert!(stages.is_known(59));
    assert_eq!(session.stats().inputs.sounds.started, 1);
}

#[test]
fn guidance_goes_further_while_a_sound_is_reacted_to() {
    let engine = |guidance| Engine::from_bytes(guided_hearing_bytes(guidance), "tiny with hearing").unwrap();
    let play = |engine: &Arc<Engine>, guidance| {
        let options = SessionOptions { guidance, ..Default::default() };
        play(&mut engine.session(options).unwrap(), &sounds()).0
    };
    let (usual, further) = (engine(1.0), engine(3.0));
    let (a, b) = (play(&usual, None), play(&further, None));
    // The first sounds are pushed before block 3; block 4 is the first that knows of them.
    assert_eq!(a[..16], b[..16]);
    assert_ne!(a[16..], b[16..]);
    assert_eq!(play(&usual, Some(1.0)), play(&further, Some(1.0)), "no guidance goes no further");
    for guidance in [-0.1, 20.5] {
        let e = Engine::from_bytes(guided_hearing_bytes(guidance), "tiny").map(drop).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::BundleInvalid, "{guidance}: {e}");
    }
}

#[test]
fn sensitivity_is_told_and_checked() {
    let engine = hearing();
    for bad in [f32::NAN, f32::INFINITY, 1.51, -2.0] {
        let e = engine.session(SessionOptions { sensitivity: bad, ..Default::default() }).unwrap_err();
        assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("sensitivity"), "{e}");
        assert!(
            session(&engine).set_sensitivity(bad).is_err() && session(&engine).controls().set_sensitivity(bad).is_err()
        );
    }
    let mut session = engine.session(SessionOptions { sensitivity: -1.0, ..Default::default() }).unwrap();
    let mut stages = Stages::default();
    session.push_sound(1, &noise(1, 10_000, 0.3), RATE, Vec3::Z).unwrap();
    (0..2).for_each(|_| drop(block(&mut session, &mut stages)));
    session.controls().set_sensitivity(1.5).unwrap();
    block(&mut session, &mut stages);
    session.set_sensitivity(0.25).unwrap();
    block(&mut session, &mut stages);
    let told: Vec<_> = (1..4).map(|i| *stages.vector(i).unwrap().last().unwrap()).collect();
    assert_eq!(told, [-1.0, 1.5, 0.25]);
}

#[test]
fn bundles_of_every_scheme_hear() {
    let (reference, _) = play(&mut session(&hearing()), &sounds());
    for scheme in [Scheme::F16, Scheme::I8, Scheme::I4] {
        let engine = hearing_in(scheme);
        assert!(engine.has_hearing());
        let recorded = &engine.config().quantisation.as_ref().unwrap().tensors;
        for layer in
            ["hearing.conv.1", "hearing.out", "flow.embed_sound.0", "student.embed_sound.2", "flow.input_sound"]
        {
            assert!(recorded.contains_key(&format!("{layer}.weight")), "{layer}");
        }
        assert_eq!(recorded["flow.embed_sound.0.weight"], scheme);
        let (frames, stages) = play(&mut session(&engine), &sounds());
        assert!(stages.is_known(6));
        assert_eq!(frames, play(&mut session(&engine), &sounds()).0);
        assert_ne!(frames, poll_blocks(&mut session(&engine), BLOCKS));
        assert_eq!(frames.len(), reference.len());
    }
}

/// Threads push at any moment while blocks are computed: nothing is lost, nothing waits.
#[test]
fn pushes_beside_a_session_that_computes() {
    let engine = hearing();
    let mut session = session(&engine);
    std::thread::scope(|scope| {
        for thread in 0..4u32 {
            let input = session.sounds();
            scope.spawn(move || {
                for i in 0..200u32 {
                    let id = thread * 100 + i / 20;
                    input.push(id, &[0.1; 700], RATE, Vec3::new(thread as f32, 1.0, 2.0)).unwrap();
                    if i % 20 == 19 {
                        input.end(id).unwrap();
                    }
                    std::thread::yield_now();
                }
            });
        }
        for _ in 0..60 {
            let frames = poll_blocks(&mut session, 1);
            assert!(frames.iter().all(|f| f.global.iter().all(|t| t.position.is_finite())));
        }
    });
    let stats = session.stats().inputs.sounds;
    assert!(stats.pieces + stats.refused >= 800 && stats.contended_samples == 0, "{stats:?}");
}
