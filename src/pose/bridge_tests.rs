//! Motion that fits is left alone; motion that does not goes on, comes over, and keeps its bones.

use super::super::synthetic::{self, Noise, Walk};
use super::super::{Decoder, Encoder, feature_count, root_of};
use super::*;
use crate::frame::{BLOCK_FRAMES, Frame, Root};
use crate::kernels::Kernels;
use crate::normaliser::Metric;

const RADIUS: f32 = 0.1;

/// The rig at rest in `frames` frames, its left arm turned by `angle(i)` about Z at the shoulder.
fn arm(rig: &Rig, frames: usize, angle: impl Fn(usize) -> f32) -> Vec<Vec<Transform>> {
    let joint = rig.index("leftUpperArm").unwrap();
    let frame = |i| {
        let mut local = vec![Quat::IDENTITY; rig.len()];
        local[joint] = Quat::from_rotation_z(angle(i));
        let mut out = vec![Transform::IDENTITY; rig.len()];
        rig.fk(rig.offset(0), &local, &mut out);
        out
    };
    (0..frames).map(frame).collect()
}

/// The frames bridged in blocks of four, the root stepping by `step(i)`.
fn bridged(rig: &Rig, frames: &[Vec<Transform>], step: impl Fn(usize) -> [f32; 3]) -> Vec<(Vec<Transform>, [f32; 3])> {
    let mut bridge = Bridge::new(rig, 1.5);
    let mut out = Vec::new();
    for (b, block) in frames.chunks(BLOCK_FRAMES).enumerate() {
        bridge.start(&block[0], block.get(1).map(Vec::as_slice), step(b * BLOCK_FRAMES));
        for (i, joints) in block.iter().enumerate() {
            let (mut joints, mut step) = (joints.clone(), step(b * BLOCK_FRAMES + i));
            bridge.apply(&mut joints, &mut step);
            out.push((joints, step));
        }
    }
    out
}

/// Angle of the left upper arm.
fn angles(rig: &Rig, frames: &[(Vec<Transform>, [f32; 3])]) -> Vec<f32> {
    let joint = rig.index("leftUpperArm").unwrap();
    frames.iter().map(|(joints, _)| joints[joint].rotation.to_scaled_axis().z).collect()
}

#[test]
fn a_motion_that_fits_is_not_touched() {
    let rig = Rig::humanoid();
    let raw = arm(&rig, 24, |i| 0.05 * i as f32 - 0.4);
    for ((joints, step), want) in bridged(&rig, &raw, |_| [0.01, 0.02, 0.03]).iter().zip(&raw) {
        assert!(joints.iter().zip(want).all(|(a, b)| a.position.distance(b.position) < 1e-5));
        assert!(Vec3::from(*step).distance(Vec3::new(0.01, 0.02, 0.03)) < 1e-6);
    }
}

#[test]
fn a_jump_becomes_a_way() {
    let rig = Rig::humanoid();
    // Still, then 0.6 rad elsewhere from frame 8 on; the root goes on at half its speed.
    let raw = arm(&rig, 40, |i| if i < 8 { 0.0 } else { 0.6 });
    let out = bridged(&rig, &raw, |i| if i < 8 { [0.0, 0.04, 0.0] } else { [0.0, 0.02, 0.0] });
    let angles = angles(&rig, &out);
    assert!(angles[8].abs() < 1e-5, "still where it was: {}", angles[8]);
    assert!(angles.windows(2).all(|w| (-1e-5..0.2).contains(&(w[1] - w[0]))), "{angles:?}");
    assert!((angles[14] - 0.6).abs() < 0.06 && (angles[39] - 0.6).abs() < 1e-3, "{angles:?}");
    let speeds: Vec<f32> = out.iter().map(|(_, step)| step[1]).collect();
    assert!((speeds[8] - 0.04).abs() < 1e-6 && (speeds[20] - 0.02).abs() < 1e-3, "{speeds:?}");
}

#[test]
fn what_is_left_at_a_border_is_carried_over_it() {
    let rig = Rig::humanoid();
    // A jump at frame 8, and nothing new at the border of frame 12.
    let raw = arm(&rig, 24, |i| if i < 8 { 0.0 } else { 0.6 });
    let angles = angles(&rig, &bridged(&rig, &raw, |_| [0.0; 3]));
    // The spring as one equation from frame 8 on; MRP and angle differ by the cube of a small
    // angle.
    for (i, angle) in angles.iter().enumerate().skip(8) {
        let t = (i - 8) as f32 / 1.5;
        let want = 0.6 - 0.6 * (1.0 + t) * (-t).exp();
        assert!((angle - want).abs() < 0.03, "frame {i}: {angle}, not {want}");
    }
}

#[test]
fn a_reset_forgets() {
    let recording = jittery(8, 0.3);
    let mut decoder = decoder(&recording.rig, Some(1.5));
    let first = blocks(&mut decoder, &recording);
    decoder.reset(Root::default());
    assert_eq!(first, blocks(&mut decoder, &recording));
}

/// A walk whose joints are off by a fresh small rotation (`amount` rad) in each block.
fn jittery(frames: usize, amount: f32) -> Walk {
    let mut recording = synthetic::walk(frames);
    let mut noise = Noise::new(3);
    let rig = recording.rig.clone();
    for block in recording.frames.chunks_mut(BLOCK_FRAMES) {
        let off: Vec<Quat> = (0..rig.len()).map(|_| Quat::from_scaled_axis(noise.vector() * amount)).collect();
        for frame in block {
            for (local, off) in frame.local.iter_mut().zip(&off).skip(1) {
                *local = *off * *local;
            }
            rig.fk(frame.hips, &frame.local, &mut frame.global);
            frame.root = root_of(&frame.global[0], 0.0);
        }
    }
    recording
}

fn decoder(rig: &Rig, frames: Option<f32>) -> Decoder {
    let decoder = Decoder::new(Kernels::detect().unwrap(), rig, RADIUS);
    match frames {
        Some(frames) => decoder.with_bridge(rig, frames),
        None => decoder,
    }
}

fn blocks(decoder: &mut Decoder, recording: &Walk) -> Vec<Frame> {
    let mut encoder = Encoder::new(RADIUS);
    let width = feature_count(recording.rig.len());
    let mut x = Metric::zeros(BLOCK_FRAMES * width);
    let mut out = recording.frames.clone();
    for block in out.chunks_exact_mut(BLOCK_FRAMES) {
        for (i, frame) in block.iter().enumerate() {
            encoder.encode(frame.root, &frame.global, x.part_mut(i..i + 1, width));
        }
        decoder.decode_block(x.view(), block).unwrap();
    }
    out
}
