//! Small constructed recordings with known answers.

use crate::recording::Recording;
use glam::{Quat, Vec3};
use visavis::{FPS, Frame, Joint, Rig, Root, Transform};

/// Seven joints: hips, head, both hands, left foot and toes, right foot. Eyes and head back 10 cm
/// before and behind.
pub fn rig() -> Rig {
    let joint = |name: &str, parent, offset| Joint { name: name.into(), parent, offset };
    Rig {
        joints: vec![
            joint("hips", None, [0.0, 0.9, 0.0]),
            joint("head", Some(0), [0.0, 0.6, 0.0]),
            joint("leftHand", Some(0), [0.7, 0.5, 0.0]),
            joint("rightHand", Some(0), [-0.7, 0.5, 0.0]),
            joint("leftFoot", Some(0), [0.1, -0.82, 0.0]),
            joint("leftToes", Some(4), [0.0, -0.06, 0.14]),
            joint("rightFoot", Some(0), [-0.1, -0.82, 0.0]),
        ],
        eyes: [0.0, 0.1, 0.1],
        head_back: [0.0, 0.1, -0.1],
    }
}

/// `n` frames at rest, each changed by `change(i, seconds, positions)`; positions are indexed as
/// the joints.
pub fn recording(n: usize, change: impl Fn(usize, f32, &mut [Vec3])) -> Recording {
    let rig = rig();
    let mut rest: Vec<Vec3> = Vec::new();
    for joint in &rig.joints {
        let from = joint.parent.map_or(Vec3::ZERO, |p| rest[p]);
        rest.push(from + Vec3::from(joint.offset));
    }
    let frames = (0..n)
        .map(|i| {
            let mut positions = rest.clone();
            change(i, i as f32 / FPS as f32, &mut positions);
            let global: Vec<_> =
                positions.iter().map(|&position| Transform { position, rotation: Quat::IDENTITY }).collect();
            let root = Root { x: f64::from(positions[0].x), z: f64::from(positions[0].z), yaw: 0.0 };
            let time = i as f64 / f64::from(FPS);
            Frame { index: i as u64, time, root, hips: positions[0], global, ..Frame::empty(rest.len()) }
        })
        .collect();
    Recording { rig, frames, user: vec![None; n], agent_voice: None, user_voice: None, gaze_target: None, sounds: None }
}

/// Fails unless `a` is `b` within `tolerance`.
#[track_caller]
pub fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b} within {tolerance}");
}
