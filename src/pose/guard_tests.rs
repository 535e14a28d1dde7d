use super::super::{Decoder, Encoder, feature_count, synthetic};
use super::*;
use crate::frame::{Frame, ROOT_CHANNELS};
use crate::kernels::Kernels;
use crate::normaliser::Metric;
use glam::Vec3;

const RADIUS: f32 = 0.1;

/// Features of somebody who walks and gestures.
fn walk(frames: usize) -> (Rig, Vec<Metric>) {
    let recording = synthetic::walk(frames);
    let mut encoder = Encoder::new(RADIUS);
    let features = recording.frames.iter().map(|f| {
        let mut x = Metric::zeros(feature_count(f.global.len()));
        encoder.encode(f.root, &f.global, x.view_mut());
        x
    });
    (recording.rig.clone(), features.collect())
}

fn decoder(rig: &Rig) -> Decoder {
    Decoder::new(Kernels::detect().unwrap(), rig, RADIUS).with_stance(rig).with_guard()
}

fn decode(decoder: &mut Decoder, features: &[Metric]) -> Vec<Frame> {
    let one = |x: &Metric| {
        let mut frame = Frame::empty(0);
        decoder.decode(x.view(), &mut frame).unwrap();
        frame
    };
    features.iter().map(one).collect()
}

/// Moves joint `j` of a feature vector.
fn fling(x: &mut [f32], j: usize, by: Vec3) {
    let (vertices, _) = x[ROOT_CHANNELS + 36 * j..][..36].as_chunks_mut::<3>();
    vertices.iter_mut().for_each(|v| *v = (Vec3::from(*v) + by).to_array());
}

/// Largest step of a joint and of the root in the world from one frame to the next, metres;
/// everything must be finite.
fn largest_step(frames: &[Frame]) -> f32 {
    let step = |w: &[Frame]| {
        assert!(w[1].global.iter().all(finite) && w[1].local.iter().all(|q| q.is_finite()) && w[1].hips.is_finite());
        let joints = w[0].global.iter().zip(&w[1].global);
        joints.map(|(a, b)| a.position.distance(b.position)).fold(0.0, f32::max)
    };
    frames.windows(2).map(step).fold(0.0, f32::max)
}

#[test]
fn motion_of_a_body_is_not_touched() {
    let (rig, features) = walk(600);
    let mut guarded = decoder(&rig);
    let mut plain = Decoder::new(Kernels::detect().unwrap(), &rig, RADIUS).with_stance(&rig);
    assert_eq!(decode(&mut guarded, &features), decode(&mut plain, &features));
    assert_eq!(guarded.guard_stats(), GuardStats::default());
}

/// A few frames of rubbish, of every kind: no joint goes further in a frame than it does without,
/// but for the cross-fade.
#[test]
fn rubbish_is_held_and_faded_over() {
    let (rig, features) = walk(300);
    let usual = largest_step(&decode(&mut decoder(&rig), &features));
    let kinds: [fn(&mut [f32]); 5] = [
        |x| x.fill(f32::NAN),
        |x| x[200] = f32::INFINITY,
        |x| x.iter_mut().for_each(|v| *v *= -1e30),
        |x| fling(x, 6, Vec3::new(0.0, 1.0, 0.5)),
        |x| x[1] = 4.0,
    ];
    for (k, rubbish) in kinds.into_iter().enumerate() {
        let mut features = features.clone();
        features[100..103].iter_mut().for_each(|x| rubbish(x.values_mut()));
        let mut decoder = decoder(&rig);
        let frames = decode(&mut decoder, &features);
        let step = largest_step(&frames);
        assert!(step < 2.0 * usual, "kind {k}: a joint moves {step} m in a frame, {usual} m without");
        assert!(frames[100..103].iter().all(|f| f.held == 1.0), "kind {k}");
        assert!(frames[..100].iter().chain(&frames[120..]).all(|f| f.held == 0.0), "kind {k}");
        let stats = decoder.guard_stats();
        let counts = [stats.non_finite, stats.joints, stats.root];
        let expected = [[3, 0, 0], [3, 0, 0], [0, 3, 3], [0, 2, 0], [0, 0, 3]][k];
        assert_eq!(counts, expected, "kind {k}");
        assert!((1..=3).contains(&stats.trips) && stats.held_frames >= 3, "kind {k}: {stats:?}");
    }
}

/// Rubbish from the first frame on: the pose before it is held, or the rig at rest where there is
/// none.
#[test]
fn rubbish_for_ever_is_a_breathing_pose() {
    let (rig, features) = walk(5);
    let rubbish = vec![Metric::new(vec![f32::NAN; features[0].values().len()]); 400];
    for primed in [true, false] {
        let mut decoder = decoder(&rig);
        if primed {
            decoder.prime(features[4].view());
        }
        let frames = decode(&mut decoder, &rubbish);
        assert!(largest_step(&frames) < 0.002, "it breathes, no more");
        let head = rig.index("head").unwrap();
        let moves = frames
            .iter()
            .map(|f| f.global[head].position.z)
            .fold([f32::MAX, f32::MIN], |[a, b], z| [a.min(z), b.max(z)]);
        assert!(moves[1] - moves[0] > 0.003, "it does breathe: {moves:?}");
        assert!(frames.iter().all(|f| f.held == 1.0 && f.fit_error < 0.02));
        assert_eq!(decoder.guard_stats().trips, 1);
    }
}

/// No features at all are answered as features without a number are, bit for bit, wherever they
/// come.
#[test]
fn a_missing_block_is_a_block_of_rubbish() {
    let (rig, features) = walk(120);
    let rubbish = Metric::new(vec![f32::NAN; features[0].values().len()]);
    let (mut missing, mut rubbished) = (decoder(&rig), decoder(&rig));
    for (i, x) in features.iter().enumerate() {
        let mut frames = [Frame::empty(0), Frame::empty(0)];
        let lost = i < 2 || (40..44).contains(&i) || i == 50 || (80..100).contains(&i);
        if lost {
            missing.miss_block_on(None, &mut frames[..1]);
        } else {
            missing.decode(x.view(), &mut frames[0]).unwrap();
        }
        rubbished.decode(if lost { rubbish.view() } else { x.view() }, &mut frames[1]).unwrap();
        assert_eq!(frames[0], frames[1], "frame {i}");
    }
    assert_eq!(missing.guard_stats(), rubbished.guard_stats());
    assert_eq!(missing.guard_stats().non_finite, 2 + 4 + 1 + 20);
}

#[test]
fn a_limb_that_stays_out_of_reach_is_never_shown() {
    let (rig, mut features) = walk(200);
    features[50..].iter_mut().for_each(|x| fling(x.values_mut(), 6, Vec3::X * 5.0));
    let frames = decode(&mut decoder(&rig), &features);
    let far = |f: &Frame| f.global.iter().map(|j| j.position.distance(f.hips)).fold(0.0, f32::max);
    assert!(frames.iter().all(|f| far(f) < 2.0));
    assert!(frames[50..].iter().all(|f| f.held == 1.0));
}

/// A pause of any length: motion slows down within half a second and comes back from where it was
/// decoded last.
#[test]
fn a_pause_eases_out_and_fades_in() {
    let (rig, features) = walk(260);
    let usual = largest_step(&decode(&mut decoder(&rig), &features));
    let mut decoder = decoder(&rig);
    let mut frames = decode(&mut decoder, &features[..100]);
    for _ in 0..300 {
        let mut frame = Frame::empty(0);
        decoder.hold_block(std::slice::from_mut(&mut frame));
        frames.push(frame);
    }
    frames.extend(decode(&mut decoder, &features[100..]));
    assert!(largest_step(&frames) < 1.5 * usual, "{} m, {usual} m without", largest_step(&frames));
    assert!(largest_step(&frames[115..400]) < 0.002, "it stands");
    assert!(frames[100..400].iter().all(|f| f.held == 1.0));
    assert!(frames[400..408].iter().all(|f| f.held > 0.0 && f.held < 1.0) && frames[409].held == 0.0);
    assert_eq!(decoder.guard_stats(), GuardStats::default(), "a pause is nothing to guard against");
}

/// What was shown, encoded: the way back from a frame that was replaced.
#[test]
fn shown_features_are_those_of_the_frame() {
    let (rig, features) = walk(50);
    let mut first = decoder(&rig);
    decode(&mut first, &features);
    let mut held = Frame::empty(0);
    first.hold_block(std::slice::from_mut(&mut held));
    let mut x = Metric::zeros(features[0].values().len());
    first.shown(x.view_mut());
    let mut again = Decoder::new(Kernels::detect().unwrap(), &rig, RADIUS);
    again.reset(held.root);
    let mut frame = Frame::empty(0);
    x.values_mut()[..ROOT_CHANNELS].fill(0.0);
    again.decode(x.view(), &mut frame).unwrap();
    let error = frame.global.iter().zip(&held.global).map(|(a, b)| a.position.distance(b.position)).fold(0.0, f32::max);
    assert!(error < 1e-4, "{error} m");
}

#[test]
fn one_trip_is_forgiven_a_rate_is_not() {
    let of = |trips, held_frames| GuardStats { trips, held_frames, ..GuardStats::default() };
    assert!(!of(0, 0).is_defective(100) && !of(1, 12).is_defective(100));
    assert!(of(2, 24).is_defective(1700) && !of(2, 24).is_defective(3600));
    assert!(of(1, 1500).is_defective(1800), "never plausible again");
    assert!(of(1, 40).is_defective(0) && !of(10, 200).is_defective(18_000));
}
