//! Frames as JavaScript reads them: each frame's numbers (f64), its joints (f32), and where the bundle
//! tells them its joints' shares (f32).

use visavis::{Frame, Sampler};

/// Numbers of a frame, f64: index, time, root x, z and yaw, hips x, y and z, fit error, gaze (NaN:
/// unknown), sampler (midpoint: its steps; single: 0; Euler: minus its steps), held.
pub const FRAME_NUMBERS: usize = 12;
/// Numbers of a joint, f32: local rotation (x, y, z, w), position, rotation in the world.
pub const JOINT_NUMBERS: usize = 11;

/// A block, laid out.
pub(crate) struct Block {
    numbers: Vec<f64>,
    joints: Vec<f32>,
    shares: Vec<f32>,
}

impl Block {
    pub(crate) fn new(joints: usize) -> Self {
        let frames = visavis::BLOCK_FRAMES;
        Self {
            numbers: vec![0.0; frames * FRAME_NUMBERS],
            joints: vec![0.0; frames * joints * JOINT_NUMBERS],
            shares: Vec::with_capacity(frames * joints),
        }
    }

    pub(crate) fn fill(&mut self, frames: &[Frame]) {
        for (f, out) in frames.iter().zip(self.numbers.chunks_exact_mut(FRAME_NUMBERS)) {
            out.copy_from_slice(&numbers(f));
        }
        let joints = frames.iter().flat_map(|f| f.global.iter().zip(&f.local));
        for ((global, local), out) in joints.zip(self.joints.chunks_exact_mut(JOINT_NUMBERS)) {
            out[..4].copy_from_slice(&local.to_array());
            out[4..7].copy_from_slice(&global.position.to_array());
            out[7..].copy_from_slice(&global.rotation.to_array());
        }
        self.shares.clear();
        self.shares.extend(frames.iter().flat_map(|f| &f.dyadic));
    }

    pub(crate) fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    pub(crate) fn joints(&self) -> &[f32] {
        &self.joints
    }

    pub(crate) fn shares(&self) -> &[f32] {
        &self.shares
    }
}

fn numbers(f: &Frame) -> [f64; FRAME_NUMBERS] {
    let [x, y, z] = f.hips.to_array().map(f64::from);
    let gaze = f.gaze.map_or(f64::NAN, f64::from);
    let (fit, held) = (f64::from(f.fit_error), f64::from(f.held));
    [f.index as f64, f.time, f.root.x, f.root.z, f.root.yaw, x, y, z, fit, gaze, sampler(f.sampler), held]
}

fn sampler(sampler: Sampler) -> f64 {
    let steps = f64::from(sampler.steps());
    match sampler {
        Sampler::Single => 0.0,
        Sampler::Euler(_) => -steps,
        _ => steps,
    }
}
