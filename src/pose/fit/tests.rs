//! The rig follows exact input exactly, and noisy input without flips.

use super::super::synthetic::{self, Noise, Walk};
use super::*;

fn fit_for(rig: &Rig) -> Fit {
    Fit::new(Kernels::detect().unwrap(), rig)
}

fn fitted(fit: &mut Fit, joints: &[Transform]) -> Frame {
    let mut frame = Frame::empty(joints.len());
    fit_at(fit, joints, &Root::default(), &mut frame);
    frame
}

fn fit_at(fit: &mut Fit, joints: &[Transform], root: &Root, frame: &mut Frame) {
    fit.turn(&mut vec![Transform::IDENTITY; joints.len()], joints, root, frame);
    fit.sign(frame);
}

fn placed(recording: &Walk, frame: &Frame) -> Vec<Transform> {
    let mut out = frame.global.clone();
    recording.rig.fk(frame.hips, &frame.local, &mut out);
    out
}

/// Positions off by `share` of the bone to the parent (standard deviation), rotations by `share`
/// radians.
fn noisy(recording: &Walk, frame: &Frame, share: f32, noise: &mut Noise) -> Vec<Transform> {
    let jitter = |(j, t): (usize, &Transform)| {
        let scale = share * if j == 0 { 0.2 } else { recording.rig.offset(j).length() };
        Transform {
            position: t.position + noise.vector() * scale,
            rotation: Quat::from_scaled_axis(noise.vector() * share) * t.rotation,
        }
    };
    frame.global.iter().enumerate().map(jitter).collect()
}

#[test]
fn exact_input_is_followed_exactly() {
    let recording = synthetic::walk(240);
    let mut fit = fit_for(&recording.rig);
    for frame in &recording.frames {
        let got = fitted(&mut fit, &frame.global);
        assert!(got.fit_error < 1e-5, "frame {}: {} m", frame.index, got.fit_error);
        for (a, b) in got.local.iter().zip(&frame.local) {
            assert!(a.dot(*b).abs() > 1.0 - 1e-5);
            assert!((a.length() - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn noise_stays_small_and_flips_nothing() {
    let recording = synthetic::walk(600);
    let mut fit = fit_for(&recording.rig);
    let mut noise = Noise::new(7);
    let ends: Vec<usize> =
        ["leftHand", "rightHand", "leftFoot", "rightFoot"].map(|n| recording.rig.index(n).unwrap()).into();
    let (mut worst, mut sum, mut worst_turn, mut all) = (0f32, 0f32, 0f32, 0f32);
    for frame in &recording.frames {
        let input = noisy(&recording, frame, 0.02, &mut noise);
        let got = fitted(&mut fit, &input);
        worst = worst.max(got.fit_error);
        let body = placed(&recording, &got);
        sum += ends.iter().map(|&j| body[j].position.distance(input[j].position)).sum::<f32>() / ends.len() as f32;
        all += body.iter().zip(&input).map(|(a, b)| a.position.distance(b.position)).sum::<f32>() / body.len() as f32;
        for (a, b) in body.iter().zip(&frame.global) {
            worst_turn = worst_turn.max(a.rotation.angle_between(b.rotation));
        }
    }
    let mean_end = sum / recording.frames.len() as f32;
    let mean = all / recording.frames.len() as f32;
    println!(
        "2 % noise, m: worst {worst:.4}, mean {mean:.4}, of hands and feet {mean_end:.4}; turn {worst_turn:.3} rad"
    );
    assert!(worst < 0.05, "largest distance {worst} m");
    assert!(mean_end < 0.003, "hands and feet {mean_end} m");
    assert!(worst_turn < 0.30, "a joint turned by {worst_turn} rad: flipped");
}

#[test]
fn signs_follow_the_frame_before() {
    let recording = synthetic::walk(900);
    let mut fit = fit_for(&recording.rig);
    let mut before: Option<Frame> = None;
    for frame in &recording.frames {
        // The sign of the input must not matter.
        let flipped = |t: &Transform| Transform { rotation: -t.rotation, ..*t };
        let joints: Vec<_> =
            if frame.index % 2 == 0 { frame.global.clone() } else { frame.global.iter().map(flipped).collect() };
        let got = fitted(&mut fit, &joints);
        if let Some(before) = &before {
            for (j, (a, b)) in got.local.iter().zip(&before.local).enumerate() {
                assert!((*a - *b).length() < 0.3, "joint {j} jumps at frame {}", frame.index);
            }
        }
        before = Some(got);
    }
}

#[test]
fn reaches_the_hand_of_a_bent_arm_with_wrong_lengths() {
    // Lower arm decoded 2 cm too long: pointing alone would leave the hand 2 cm short.
    let (middle, end) = (Vec3::new(0.27, 0.0, 0.0), Vec3::new(0.27, 0.0, 0.27));
    let e = limb_target(middle, end, (0.27, 0.25));
    assert!((e.length() - 0.27).abs() < 1e-6);
    let error = (end.distance(e) - 0.25).abs();
    assert!(error < 0.004, "{error}");
    assert!(e.distance(middle) < 0.025);
}

#[test]
fn degenerate_input_gives_unit_quaternions() {
    let rig = Rig::humanoid();
    let mut fit = fit_for(&rig);
    let collapsed = vec![Transform::IDENTITY; rig.len()];
    let mut upside_down = collapsed.clone();
    rig.fk(Vec3::Y, &vec![Quat::IDENTITY; rig.len()], &mut upside_down);
    for t in &mut upside_down {
        t.position.y = -t.position.y;
    }
    for joints in [collapsed, upside_down] {
        let got = fitted(&mut fit, &joints);
        assert!(got.local.iter().all(|q| (q.length() - 1.0).abs() < 1e-5), "{:?}", got.local);
        assert!(got.fit_error.is_finite());
    }
}

#[test]
fn far_from_the_origin_the_heading_frame_keeps_precision() {
    let recording = synthetic::walk(2);
    let frame = &recording.frames[1];
    let root = Root { x: 4_000.0, z: -7_000.0, yaw: 1.0 };
    let mut got = Frame::empty(recording.rig.len());
    fit_at(&mut fit_for(&recording.rig), &frame.global, &root, &mut got);
    assert!(got.fit_error < 1e-5);
    let turned = root.rotation() * frame.local[0];
    assert!(got.local[0].dot(turned).abs() > 1.0 - 1e-5);
    assert!(got.hips.distance(root.to_world(frame.hips)) < 1e-3);
}

#[test]
fn a_nearly_straight_leg_does_not_pop() {
    // Decoded 1 cm too short, the knee passing through the straight line: no jump, and no knee that
    // juts out.
    let mut before: Option<Vec3> = None;
    for i in -50..=50 {
        let middle = Vec3::new(0.0, -0.405, i as f32 * 2e-4);
        let e = limb_target(middle, Vec3::new(0.0, -0.805, 0.0), (0.415, 0.40)).normalize() * 0.415;
        assert!(e.distance(middle) < 0.02, "{i}: {e}");
        assert!(before.is_none_or(|b| b.distance(e) < 2e-3), "{i}: {e} after {before:?}");
        before = Some(e);
    }
}
