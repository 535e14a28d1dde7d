//! A procedural person: sways, breathes, gestures while it speaks and turns to a user who
//! approaches, circles and leaves.
//!
//! No model is involved; it gives exporters and the viewer something to show.

use glam::{EulerRot, Quat, Vec3};
use std::f32::consts::{PI, TAU};
use visavis::internals::frame::FRAME_SAMPLES;
use visavis::{FPS, Frame, Joint, Rig, Root, Sampler, Transform};
use visavis_tools::recording::Recording;

/// An adult of about 1.70 m in a T-pose.
pub fn rig() -> Rig {
    const JOINTS: [(&str, isize, [f32; 3]); 22] = [
        ("hips", -1, [0.0, 0.93, 0.0]),
        ("spine", 0, [0.0, 0.09, -0.01]),
        ("chest", 1, [0.0, 0.12, -0.005]),
        ("upperChest", 2, [0.0, 0.12, 0.0]),
        ("neck", 3, [0.0, 0.16, -0.01]),
        ("head", 4, [0.0, 0.09, 0.02]),
        ("leftShoulder", 3, [0.03, 0.10, 0.0]),
        ("leftUpperArm", 6, [0.135, 0.0, -0.01]),
        ("leftLowerArm", 7, [0.27, 0.0, 0.0]),
        ("leftHand", 8, [0.24, 0.0, 0.0]),
        ("rightShoulder", 3, [-0.03, 0.10, 0.0]),
        ("rightUpperArm", 10, [-0.135, 0.0, -0.01]),
        ("rightLowerArm", 11, [-0.27, 0.0, 0.0]),
        ("rightHand", 12, [-0.24, 0.0, 0.0]),
        ("leftUpperLeg", 0, [0.09, -0.04, 0.0]),
        ("leftLowerLeg", 14, [0.0, -0.40, 0.01]),
        ("leftFoot", 15, [0.0, -0.41, -0.03]),
        ("leftToes", 16, [0.0, -0.06, 0.13]),
        ("rightUpperLeg", 0, [-0.09, -0.04, 0.0]),
        ("rightLowerLeg", 18, [0.0, -0.40, 0.01]),
        ("rightFoot", 19, [0.0, -0.41, -0.03]),
        ("rightToes", 20, [0.0, -0.06, 0.13]),
    ];
    let joint = |&(name, parent, offset): &(&str, isize, [f32; 3])| Joint {
        name: name.to_owned(),
        parent: usize::try_from(parent).ok(),
        offset,
    };
    Rig { joints: JOINTS.iter().map(joint).collect(), eyes: [0.0, 0.075, 0.095], head_back: [0.0, 0.075, -0.095] }
}

/// Smooth noise in -1..1: a sum of sines whose frequencies do not repeat within minutes.
fn drift(t: f32, rate: f32, phase: f32) -> f32 {
    (0.55 * (rate * t + phase).sin() + 0.3 * (rate * 1.73 * t + 2.1 * phase).sin() + 0.15 * (rate * 3.1 * t).cos())
        .clamp(-1.0, 1.0)
}

fn smooth(from: f32, to: f32, t: f32) -> f32 {
    let x = ((t - from) / (to - from)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Loudness of the agent (0 to 1): it speaks for five seconds, listens for five.
fn speaking(t: f32) -> f32 {
    let phase = t % 10.0;
    smooth(0.2, 0.6, phase) * (1.0 - smooth(4.8, 5.2, phase))
}

/// The user's head: comes from 4 m, circles three quarters of the way round, steps away.
fn user(t: f32) -> Vec3 {
    let angle = 1.45 * PI * smooth(6.0, 23.0, t) - 0.15;
    let distance = 4.0 - 2.4 * smooth(0.0, 6.0, t) + 1.6 * smooth(24.0, 29.0, t);
    let bob = 0.012 * (t * 9.0).sin();
    Vec3::new(distance * angle.sin(), 1.66 + bob, distance * angle.cos())
}

/// A voice-like signal: syllables on a gliding pitch.
fn voice(t: f32, loudness: f32, pitch: f32) -> f32 {
    let syllable = (TAU * 2.1 * t + 1.3 * (1.7 * t).sin()).sin().max(0.0).powf(0.7);
    let phase = TAU * (pitch * t + 1.5 * (2.3 * t).sin());
    let tone: f32 = [1.0, 0.6, 0.45, 0.2].iter().enumerate().map(|(k, a)| a * (phase * (k + 1) as f32).sin()).sum();
    0.22 * loudness * syllable * tone
}

/// Local rotations at time `t` with the head still to turn by `look` (radians, left positive).
fn pose(t: f32, look: f32, pitch: f32) -> Vec<Quat> {
    let turn = |x: f32, y: f32, z: f32| Quat::from_euler(EulerRot::YXZ, y, x, z);
    let talk = speaking(t);
    let beat = talk * (TAU * 1.05 * t + 0.65 * (1.7 * t).sin()).sin();
    let sway = drift(t, 0.7, 0.0);
    let mut q = vec![Quat::IDENTITY; 22];
    q[0] = turn(0.0, 0.0, 0.02 * sway);
    q[1] = turn(0.03 + 0.01 * (t * 1.4).sin(), 0.12 * look, -0.03 * sway);
    q[2] = turn(0.02, 0.15 * look, -0.01 * sway);
    q[3] = turn(-0.02 + 0.02 * beat, 0.15 * look, 0.0);
    q[4] = turn(0.05, 0.25 * look, 0.02 * drift(t, 1.1, 2.0));
    q[5] = turn(-0.04 + pitch + 0.05 * talk * drift(t, 4.0, 1.0), 0.33 * look, 0.05 * drift(t, 0.9, 4.0));
    for (side, arm, phase) in [(1.0, 6, 0.0), (-1.0, 10, 1.9)] {
        let lift = talk * (0.55 + 0.45 * drift(t, 0.9, phase));
        let open = talk * drift(t, 1.3, 3.0 + phase);
        q[arm] = turn(0.0, 0.0, side * (0.06 * lift - 0.03));
        // Down from the T-pose, a little forward.
        q[arm + 1] = Quat::from_rotation_y(-side * (0.15 + 0.45 * lift))
            * Quat::from_rotation_z(-side * (1.27 - 0.18 * lift + 0.06 * open));
        // Elbows bend about the axis that lies across the hanging arm; then the forearm turns in.
        let bend = 0.3 + 1.35 * lift + 0.22 * beat;
        q[arm + 2] = Quat::from_rotation_y(-side * bend) * Quat::from_rotation_x(-0.5 - 0.5 * open);
        q[arm + 3] = turn(0.15 * open, -side * 0.1, side * (0.1 + 0.25 * beat));
    }
    q
}

/// The recording: `seconds` long, with both voices.
pub fn recording(seconds: f32) -> Recording {
    let rig = rig();
    let count = (seconds * FPS as f32) as usize;
    let mut yaw = 0.0_f32;
    let mut frames = Vec::with_capacity(count);
    for i in 0..count {
        let t = i as f32 / FPS as f32;
        let head = user(t);
        let wrap = |a: f32| a - TAU * (a / TAU).round();
        let bearing = wrap(head.x.atan2(head.z) - yaw);
        // The body follows slowly and only when the neck no longer reaches; the head takes the
        // rest.
        let aside = 0.35 * (t * 0.8).sin().max(0.0).powi(3) * (1.0 - 0.6 * speaking(t));
        let step = (bearing.abs() - 0.45).clamp(0.0, 0.5) * bearing.signum() * 0.09;
        yaw = wrap(yaw + step);
        let look = (wrap(head.x.atan2(head.z) - yaw) + aside).clamp(-1.3, 1.3);
        let mut local = pose(t, look, 0.02);
        let sway = drift(t, 0.7, 0.0);
        let hips =
            Vec3::new(0.0, 0.915 + 0.004 * (t * 1.4).sin(), 0.0) + Quat::from_rotation_y(yaw) * Vec3::X * 0.025 * sway;
        local[0] = Quat::from_rotation_y(yaw) * local[0];
        plant(&rig, hips, yaw, step * 11.0, t, &mut local);
        let global = forward(&rig, hips, &local);
        let eyes = global[5].position + global[5].rotation * Vec3::from(rig.eyes);
        let back = global[5].position + global[5].rotation * Vec3::from(rig.head_back);
        let gaze = (eyes - back).normalize().dot((head - back).normalize());
        let root = Root { x: f64::from(hips.x), z: f64::from(hips.z), yaw: f64::from(yaw) };
        let sampler = if (300..330).contains(&i) { Sampler::Single } else { Sampler::Midpoint4 };
        frames.push(Frame {
            index: i as u64,
            time: f64::from(t),
            root,
            global,
            hips,
            local,
            gaze: Some(gaze),
            sampler,
            ..Frame::empty(0)
        });
    }
    let samples = count * FRAME_SAMPLES;
    let talk = |speaker: fn(f32) -> f32, pitch: f32| {
        Some((0..samples).map(|i| i as f32 / 24_000.0).map(|t| voice(t, speaker(t), pitch)).collect())
    };
    Recording {
        rig,
        user: (0..count).map(|i| Some(user(i as f32 / FPS as f32))).collect(),
        frames,
        agent_voice: talk(speaking, 190.0),
        user_voice: talk(|t| speaking(t + 5.0), 115.0),
        gaze_target: Some(0.9),
        sounds: None,
    }
}

/// Bends the legs so that the ankles stand beside the root; while the body turns, the feet step in
/// turns.
fn plant(rig: &Rig, hips: Vec3, yaw: f32, turning: f32, t: f32, local: &mut [Quat]) {
    for (side, leg, phase) in [(1.0_f32, 14, 0.0), (-1.0, 18, PI)] {
        let heading = Quat::from_rotation_y(yaw + side * 0.12);
        let lift = 0.05 * (turning.abs() * 4.0).min(1.0) * (TAU * 1.4 * t + phase).sin().max(0.0);
        let ankle = Quat::from_rotation_y(yaw) * Vec3::new(side * 0.11, 0.08 + lift, -0.02);
        let joint = hips + local[0] * Vec3::from(rig.joints[leg].offset);
        let (thigh, shin) = (Vec3::from(rig.joints[leg + 1].offset), Vec3::from(rig.joints[leg + 2].offset));
        let reach = (ankle - joint).length().min(thigh.length() + shin.length() - 1e-4);
        let (a, b) = (thigh.length(), shin.length());
        let corner = |opposite: f32, x: f32, y: f32| {
            ((x * x + y * y - opposite * opposite) / (2.0 * x * y)).clamp(-1.0, 1.0).acos()
        };
        let along = (ankle - joint).normalize();
        let axis = (heading * Vec3::X).reject_from_normalized(along).normalize();
        let thigh_dir = Quat::from_axis_angle(axis, -corner(b, a, reach)) * along;
        let knee = joint + a * thigh_dir;
        let frame = |down: Vec3, rest: Vec3| {
            let turn = Quat::from_rotation_arc((heading * rest).normalize(), down.normalize());
            turn * heading
        };
        let upper = frame(thigh_dir, thigh);
        let lower = frame(ankle - knee, shin);
        local[leg] = local[0].inverse() * upper;
        local[leg + 1] = upper.inverse() * lower;
        local[leg + 2] = lower.inverse() * heading;
    }
}

/// Global transforms of the rig.
fn forward(rig: &Rig, hips: Vec3, local: &[Quat]) -> Vec<Transform> {
    let mut out: Vec<Transform> = Vec::with_capacity(local.len());
    for (joint, &rotation) in rig.joints.iter().zip(local) {
        out.push(match joint.parent {
            None => Transform { position: hips, rotation },
            Some(p) => Transform {
                position: out[p].position + out[p].rotation * Vec3::from(joint.offset),
                rotation: out[p].rotation * rotation,
            },
        });
    }
    out
}
