//! Procedural motion for tests: somebody who walks in a circle, gestures and looks around.

use super::{Rig, gaze_score, root_of};
use crate::frame::{FPS, Frame, Transform};
use glam::{Quat, Vec3};

/// Procedural motion.
#[derive(Debug, Clone)]
pub struct Walk {
    /// The reference rig.
    pub rig: Rig,
    /// Frames at 30 fps, consecutive.
    pub frames: Vec<Frame>,
    /// World position of the user's head at each frame, metres; `None` where unknown.
    pub user: Vec<Option<Vec3>>,
}

/// Radius of the circle, metres.
const CIRCLE: f64 = 2.0;
/// Walking speed, m/s.
const SPEED: f64 = 1.0;

/// `frames` frames of walking on the reference rig; bone lengths exact, `global` = kinematics of
/// `local`. The user walks ahead and is not seen in frames 0 to 9 and 40 to 49.
pub fn walk(frames: usize) -> Walk {
    let rig = Rig::humanoid();
    let user = |i: usize| {
        let a = i as f32 * 0.01;
        (i >= 10 && !(40..50).contains(&i)).then(|| Vec3::new(2.0 + a.sin(), 1.6, 2.0 + a.cos()))
    };
    let users: Vec<_> = (0..frames).map(user).collect();
    let frames: Vec<_> = users.iter().enumerate().map(|(i, &user)| frame(&rig, i, user)).collect();
    Walk { rig, frames, user: users }
}

fn frame(rig: &Rig, i: usize, user: Option<Vec3>) -> Frame {
    let t = i as f64 / f64::from(FPS);
    let around = SPEED / CIRCLE * t;
    let phase = (t * std::f64::consts::TAU) as f32;
    let hips = Vec3::new(
        (CIRCLE * (1.0 - around.cos())) as f32,
        0.90 + 0.02 * (2.0 * phase).cos(),
        (CIRCLE * around.sin()) as f32,
    );
    let mut local = vec![Quat::IDENTITY; rig.len()];
    for (joint, q) in rig.joints.iter().zip(&mut local) {
        *q = rotation(&joint.name, phase, t as f32);
    }
    local[0] = Quat::from_rotation_y(around as f32) * local[0];
    let mut global = vec![Transform::IDENTITY; rig.len()];
    rig.fk(hips, &local, &mut global);
    let root = root_of(&global[0], 0.0);
    let head = rig.index("head").expect("reference rig");
    let gaze = user.and_then(|u| gaze_score(rig, &global[head], u));
    Frame { index: i as u64, time: t, root, global, hips, local, gaze, ..Frame::empty(0) }
}

fn rotation(name: &str, phase: f32, t: f32) -> Quat {
    let (x, y, z) = (Quat::from_rotation_x, Quat::from_rotation_y, Quat::from_rotation_z);
    // The left side leads by half a step; arms swing against legs.
    let (side, phase) = match name.strip_prefix("left") {
        Some(_) => (1.0, phase),
        None => (-1.0, phase + std::f32::consts::PI),
    };
    match name.trim_start_matches("left").trim_start_matches("right") {
        "hips" => x(0.05) * z(0.04 * phase.sin()),
        "spine" => y(0.1 * phase.sin()),
        "chest" => x(0.06 * (0.7 * t).sin()),
        "neck" => y(0.2 * (0.9 * t).sin()),
        "head" => y(0.5 * (1.1 * t).sin()) * x(0.2 * (1.7 * t).cos()),
        "Shoulder" => z(0.05 * side),
        // Arms hang (turned down from the T-pose) and lift now and then in front of the body.
        "UpperArm" => x(0.4 * phase.sin() - 0.5 * (0.6 * t).sin().max(0.0)) * z(-1.25 * side),
        "LowerArm" => y(-side * (0.5 + 1.2 * (0.6 * t).sin().max(0.0))) * x(0.8 * (1.3 * t).sin()),
        "Hand" => z(0.3 * (2.0 * t).sin()),
        "UpperLeg" => x(-0.1 - 0.45 * phase.sin()) * y(0.1 * side),
        "LowerLeg" => x(0.45 - 0.35 * (phase + 0.6).sin()),
        "Foot" => x(0.15 * phase.cos()),
        _ => Quat::IDENTITY,
    }
}

/// Reproducible noise.
pub struct Noise(u64);

impl Noise {
    /// Noise that depends on `seed` alone.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform, -1 to 1 (SplitMix64).
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    /// Three independent values of mean 0 and standard deviation 1, at most sqrt(12) each (the sum
    /// of four uniform ones).
    pub fn vector(&mut self) -> Vec3 {
        let mut value = || (0..4).map(|_| self.next()).sum::<f32>() * (3.0f32 / 4.0).sqrt();
        Vec3::new(value(), value(), value())
    }
}
