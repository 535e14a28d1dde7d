//! Borders between blocks: motion goes on as it was going and comes over to what the new block
//! says.
//!
//! Blocks are decoded one by one, and the first frames of a block need not continue the last frames
//! of the one before. At each border the motion as decoded is taken one frame further, with the
//! mean of the velocities before and after, and what the new block has there instead, in place and
//! in the other half of the velocity, is the *difference*. It is added to the new block's frames
//! and dies away as a critically damped spring lets it (inertialisation: Bollo 2018). What is left
//! of earlier differences goes on over the border, nothing is dropped there; no frame waits for
//! another, and blocks that fit are not touched.
//!
//! Everything is relative to the parent joint: rotations, and the offset from the parent, which
//! carries the bone's length. The root enters as its step, so that a body that moves keeps moving.

use super::Rig;
use crate::frame::Transform;
use glam::{Quat, Vec3};

/// No difference of a joint is taken for larger than this, radians: what is further off jumps by
/// the rest.
const MAX_ANGLE: f32 = 1.5;

/// A difference and its change a frame.
#[derive(Debug, Clone, Copy, Default)]
struct Spring {
    at: Vec3,
    speed: Vec3,
}

/// A joint relative to its parent (the hips: to the heading frame).
#[derive(Debug, Clone, Copy)]
struct Link {
    turn: Quat,
    offset: Vec3,
}

#[derive(Debug, Clone, Copy)]
struct Joint {
    parent: Option<usize>,
    /// As decoded in the last frame and in the one before.
    decoded: [Link; 2],
    /// As modified Rodrigues parameters, in the parent's frame.
    turn: Spring,
    offset: Spring,
}

/// Bridges borders between blocks of poses. Streaming; allocates nothing once made.
#[derive(Debug, Clone)]
pub(super) struct Bridge {
    joints: Vec<Joint>,
    /// The last step as decoded.
    step: Vec3,
    steps: Spring,
    /// Frames since the start, up to two.
    known: usize,
    /// Decay a frame, and the same as a factor.
    rate: f32,
    keep: f32,
}

impl Bridge {
    /// For a rig; a difference dies away with the time constant `frames` (above 0): to 0.41 after
    /// twice as many frames, to 0.09 after four times as many.
    pub(super) fn new(rig: &Rig, frames: f32) -> Self {
        let rest = Link { turn: Quat::IDENTITY, offset: Vec3::ZERO };
        let joint = |parent| Joint { parent, decoded: [rest; 2], turn: Spring::default(), offset: Spring::default() };
        let rate = 1.0 / frames;
        Self {
            joints: rig.joints.iter().map(|j| joint(j.parent)).collect(),
            step: Vec3::ZERO,
            steps: Spring::default(),
            known: 0,
            rate,
            keep: libm::expf(-rate),
        }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        self.known = 0;
        self.steps = Spring::default();
        self.joints.iter_mut().for_each(|j| (j.turn, j.offset) = (Spring::default(), Spring::default()));
    }

    /// A border: measures the difference to the new block, of which `first` and, if it has one,
    /// `second` are the joints in their heading frames, and `step` is the root's first step.
    pub(super) fn start(&mut self, first: &[Transform], second: Option<&[Transform]>, step: [f32; 3]) {
        if self.known < 2 {
            return;
        }
        for (j, joint) in self.joints.iter_mut().enumerate() {
            let [last, before] = joint.decoded;
            let next = link(joint.parent, j, first);
            let after = second.map(|joints| link(joint.parent, j, joints));
            let (mut going, mut moving) = (parameters(last.turn * before.turn.inverse()), last.offset - before.offset);
            if let Some(after) = after {
                let change = 0.5 * (parameters(after.turn * next.turn.inverse()) - going);
                (going, joint.turn.speed) = (going + change, joint.turn.speed - change);
                let change = 0.5 * (after.offset - next.offset - moving);
                (moving, joint.offset.speed) = (moving + change, joint.offset.speed - change);
            }
            let reached = rotation_of(joint.turn.at) * rotation_of(going) * last.turn;
            joint.turn.at = parameters(reached * next.turn.inverse()).clamp_length_max(MAX_ANGLE / 4.0);
            joint.offset.at += last.offset + moving - next.offset;
        }
        self.steps.at += self.step - Vec3::from(step);
    }

    /// The next frame of the block: adds what is left of the difference to `joints` (in the frame's
    /// heading frame) and to the root's `step` to it.
    pub(super) fn apply(&mut self, joints: &mut [Transform], step: &mut [f32; 3]) {
        let (rate, keep) = (self.rate, self.keep);
        // Links first: parents are moved before their children.
        for j in (0..joints.len()).rev() {
            let link = link(self.joints[j].parent, j, joints);
            joints[j] = Transform { position: link.offset, rotation: link.turn };
        }
        for j in 0..joints.len() {
            let joint = &mut self.joints[j];
            let Transform { position, rotation } = joints[j];
            let turn = (rotation_of(joint.turn.at) * rotation).normalize();
            let offset = position + joint.offset.at;
            joint.decoded = [Link { turn: rotation, offset: position }, joint.decoded[0]];
            joint.turn.advance(rate, keep);
            joint.offset.advance(rate, keep);
            joints[j] = match joint.parent {
                None => Transform { position: offset, rotation: turn },
                Some(p) => {
                    let Transform { position, rotation } = joints[p];
                    Transform { position: position + rotation * offset, rotation: (rotation * turn).normalize() }
                }
            };
        }
        self.step = Vec3::from(*step);
        *step = (self.step + self.steps.at).to_array();
        self.steps.advance(rate, keep);
        self.known = (self.known + 1).min(2);
    }
}

impl Spring {
    /// One frame on: `x'' = -2 rate x' - rate^2 x`, exactly; `keep` is `exp(-rate)`.
    fn advance(&mut self, rate: f32, keep: f32) {
        let pull = self.speed + rate * self.at;
        self.at = keep * (self.at + pull);
        self.speed = keep * (self.speed - rate * pull);
    }
}

/// Joint `j` of `joints` as its parent sees it.
fn link(parent: Option<usize>, j: usize, joints: &[Transform]) -> Link {
    let Transform { position, rotation } = joints[j];
    match parent {
        None => Link { turn: rotation, offset: position },
        Some(p) => {
            let back = joints[p].rotation.inverse();
            Link { turn: (back * rotation).normalize(), offset: back * (position - joints[p].position) }
        }
    }
}

/// Modified Rodrigues parameters, `axis tan(angle / 4)`: additive enough for differences below a
/// right angle, and without functions that platforms round differently.
fn parameters(q: Quat) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    Vec3::new(q.x, q.y, q.z) / (1.0 + q.w)
}

/// The rotation of modified Rodrigues parameters.
fn rotation_of(m: Vec3) -> Quat {
    let square = m.length_squared();
    let v = 2.0 * m;
    let scale = 1.0 / (1.0 + square);
    Quat::from_xyzw(v.x * scale, v.y * scale, v.z * scale, (1.0 - square) * scale)
}

#[cfg(test)]
#[path = "bridge_tests.rs"]
mod tests;
