//! Feet that stand stay where they are.
//!
//! The root's displacement and the joints around it are decoded apart, each with an error of its
//! own, and a foot that should stand slides by the sum. Two corrections, in this order:
//!
//! | file | what |
//! |---|---|
//! | `root` | each step of the root is turned and moved by the motion of the planted feet: where the body is in the world cannot be seen, a sliding foot can |
//! | `legs` | what is left, since two feet do not agree on one root, is taken up by the legs: each planted foot is put on the floor, where it keeps its place and direction |
//! | `ik` | the leg that puts an ankle where it should be |
//!
//! A foot is planted as far as its lowest point, heel or toes, is near the floor and slow; both
//! fade, so that nothing jumps when a foot lands or lifts. A planted foot comes down to the floor, flat if
//! it nearly is; feet below the floor are lifted onto it.

mod ik;
mod legs;
mod root;

use super::Rig;
use crate::frame::{FPS, Transform};
use glam::{Vec2, Vec3};

/// A foot this far above its height at rest is fully planted; above the second number it is not,
/// metres.
const HEIGHT: [f32; 2] = [0.015, 0.05];
/// A planted foot whose heel is this much higher or lower than its toes is put flat; from the second
/// number on it is left as it is, metres.
const TIPPED: [f32; 2] = [0.005, 0.02];
/// A foot this slow is fully planted; faster than the second number it swings, m/s.
const SPEED: [f32; 2] = [0.25, 0.8];

/// Holds planted feet. Streaming: it remembers where the feet were; allocates nothing.
#[derive(Debug, Clone)]
pub(super) struct Stance {
    sides: Option<[Side; 2]>,
}

/// One foot, with what it needs from the frame before.
#[derive(Debug, Clone)]
struct Side {
    foot: Foot,
    leg: Option<legs::Leg>,
    /// Heel and toes as decoded, in the heading frame of the frame before.
    before: Option<[Vec3; 2]>,
}

/// Heel and toes: joint and height at rest.
#[derive(Debug, Clone, Copy)]
struct Foot([(usize, f32); 2]);

/// How a foot touches the floor.
#[derive(Debug, Clone, Copy)]
struct Contact {
    /// 0 for the heel, 1 for the toes: the lower one.
    low: usize,
    /// Height of each above its height at rest, metres.
    clearance: [f32; 2],
}

impl Stance {
    /// For a rig; one without feet is left alone, one without whole legs has its root corrected
    /// only.
    pub(super) fn new(rig: &Rig) -> Self {
        let side = |name: &str| {
            let point = |joint: &str| {
                let joint = rig.index(&format!("{name}{joint}"))?;
                let chain = std::iter::successors(Some(joint), |&j| rig.joints[j].parent);
                Some((joint, chain.map(|j| rig.joints[j].offset[1]).sum()))
            };
            let foot = Foot([point("Foot")?, point("Toes")?]);
            Some(Side { foot, leg: legs::Leg::new(rig, name), before: None })
        };
        Self { sides: side("left").zip(side("right")).map(|(l, r)| [l, r]) }
    }

    /// Forgets where the feet were.
    pub(super) fn reset(&mut self) {
        for side in self.sides.iter_mut().flatten() {
            side.before = None;
            side.leg.iter_mut().for_each(legs::Leg::reset);
        }
    }

    /// Takes a decoded frame, `joints` in its heading frame and its root's `step` `(vx, vz, dyaw)`
    /// in that of the frame before; moves the legs of `joints` and returns the corrected step.
    pub(super) fn hold(&mut self, joints: &mut [Transform], step: [f32; 3]) -> [f32; 3] {
        let Some(sides) = &mut self.sides else { return step };
        let now = [0, 1].map(|s| sides[s].foot.points(joints));
        let contacts = [0, 1].map(|s| sides[s].foot.contact(&now[s]));
        let before = [0, 1].map(|s| sides[s].before.replace(now[s]));
        let [Some(left), Some(right)] = before else {
            for s in [0, 1] {
                if let Some(leg) = &mut sides[s].leg {
                    leg.start(joints, &contacts[s], &now[s]);
                }
            }
            return step;
        };
        let before = [left, right];
        let step = root::correct(&contacts, &before, &now, step);
        for s in [0, 1] {
            if let Some(leg) = &mut sides[s].leg {
                leg.hold(joints, &contacts[s], &before[s], &now[s], step);
            }
        }
        step
    }
}

impl Foot {
    fn points(&self, joints: &[Transform]) -> [Vec3; 2] {
        self.0.map(|(joint, _)| joints[joint].position)
    }

    fn contact(&self, points: &[Vec3; 2]) -> Contact {
        let clearance = [0, 1].map(|i| points[i].y - self.0[i].1);
        Contact { low: usize::from(clearance[1] < clearance[0]), clearance }
    }
}

impl Contact {
    /// How much a foot stands whose lowest point moved by `slide` (metres) over the floor in a
    /// frame, 0 to 1.
    fn planted(&self, slide: Vec2) -> f32 {
        fade(self.clearance[self.low], HEIGHT) * slow(slide)
    }

    /// How far heel and toes go down, metres, where the lowest point moved by `slide`: the foot to the
    /// floor, or up to it from below, then the point that is higher, as far as the foot is nearly flat.
    fn down(&self, slide: Vec2) -> [f32; 2] {
        let (low, high) = (self.clearance[self.low], self.clearance[1 - self.low]);
        let planted = self.planted(slide);
        let foot = if low > 0.0 { planted * low } else { low };
        let tipped = high - low;
        let mut down = [foot + planted * fade(tipped, TIPPED) * tipped; 2];
        down[self.low] = foot;
        down
    }
}

/// How much a point that moved by `slide` (metres) over the floor in a frame stands, 0 to 1.
fn slow(slide: Vec2) -> f32 {
    fade(slide.length() * FPS as f32, SPEED)
}

/// The floor coordinates `(x, z)` of a point of this frame's heading frame, in that of the frame
/// before; `step` lies between.
fn earlier(p: Vec3, [vx, vz, dyaw]: [f32; 3]) -> Vec2 {
    turned(floor(p), dyaw) + Vec2::new(vx, vz)
}

/// `(x, z)` turned by `yaw` about Y.
fn turned(p: Vec2, yaw: f32) -> Vec2 {
    let (s, c) = libm::sincosf(yaw);
    Vec2::new(c * p.x + s * p.y, c * p.y - s * p.x)
}

/// The turn about Y from the direction `from` to the direction `to`, radians: positive yaw turns +Z
/// towards +X.
fn turn(from: Vec2, to: Vec2) -> f32 {
    libm::atan2f(to.x * from.y - to.y * from.x, to.dot(from))
}

/// 1 up to the first limit, 0 from the second on, smooth between.
fn fade(value: f32, [full, none]: [f32; 2]) -> f32 {
    let t = ((none - value) / (none - full)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn floor(p: Vec3) -> Vec2 {
    Vec2::new(p.x, p.z)
}

#[cfg(test)]
mod tests;
