//! The root from the feet that stand: what is planted stays where it is.
//!
//! The root's displacement and the joints around it are decoded apart, each with an error of its own, and a foot that
//! should stand slides by the sum. Where the body is in the world cannot be seen; a sliding foot can. So each step of
//! the root is corrected by the motion of the planted feet: turned so that the line between two planted feet keeps
//! its direction, then moved so that their mean stays. Weights fade in and out, hence no jump when a foot lands or lifts.

use super::Rig;
use crate::frame::{FPS, Transform};
use glam::{Vec2, Vec3};

/// A foot this far above its height at rest is fully planted; above the second number it is not, metres.
const HEIGHT: [f32; 2] = [0.015, 0.05];
/// A foot this slow is fully planted; faster than the second number it swings, m/s.
const SPEED: [f32; 2] = [0.25, 0.8];

/// Heel and toes of one foot: joint and height at rest.
type Foot = [(usize, f32); 2];

/// Corrects root steps. Streaming: it remembers where the feet were; allocates nothing.
#[derive(Debug, Clone)]
pub(super) struct Stance {
    feet: Option<[Foot; 2]>,
    /// Heel and toes of both feet in the heading frame of the frame before.
    previous: Option<[[Vec3; 2]; 2]>,
}

impl Stance {
    /// For a rig; one without feet is left alone.
    pub(super) fn new(rig: &Rig) -> Self {
        let foot = |names: [&str; 2]| -> Option<Foot> {
            let point = |name: &str| {
                let joint = rig.index(name)?;
                let chain = std::iter::successors(Some(joint), |&j| rig.joints[j].parent);
                Some((joint, chain.map(|j| rig.joints[j].offset[1]).sum()))
            };
            Some([point(names[0])?, point(names[1])?])
        };
        let feet = foot(["leftFoot", "leftToes"]).zip(foot(["rightFoot", "rightToes"]));
        Self { feet: feet.map(|(l, r)| [l, r]), previous: None }
    }

    /// Forgets where the feet were.
    pub(super) fn reset(&mut self) {
        self.previous = None;
    }

    /// The corrected step `(vx, vz, dyaw)` for a decoded one; `joints` are in this frame's heading frame, `step` is in that
    /// of the frame before.
    pub(super) fn correct(&mut self, joints: &[Transform], step: [f32; 3]) -> [f32; 3] {
        let Some(feet) = self.feet else { return step };
        let now = feet.map(|foot| foot.map(|(joint, _)| joints[joint].position));
        let Some(before) = self.previous.replace(now) else { return step };
        let [vx, vz, dyaw] = step;

        // Each foot's lowest point, before and now, on the floor: `(x, z)` in the heading frames.
        let mut points = [(Vec2::ZERO, Vec2::ZERO); 2];
        let mut weights = [0.0f32; 2];
        for (f, foot) in feet.iter().enumerate() {
            let clearance = |i: usize| now[f][i].y - foot[i].1;
            let low = usize::from(clearance(1) < clearance(0));
            points[f] = (before[f][low].xz_plane(), now[f][low].xz_plane());
            let slide = turned(points[f].1, dyaw) + Vec2::new(vx, vz) - points[f].0;
            weights[f] = fade(clearance(low), HEIGHT) * fade(slide.length() * FPS as f32, SPEED);
        }
        let most = weights[0].max(weights[1]);
        if most == 0.0 {
            return step;
        }
        let (was, is) = (points[1].0 - points[0].0, turned(points[1].1 - points[0].1, dyaw));
        // Positive yaw turns +Z towards +X: from `is` to `was`.
        let twist = libm::atan2f(was.x * is.y - was.y * is.x, was.dot(is));
        let dyaw = dyaw + weights[0].min(weights[1]) * twist;

        let slide = |f: usize| turned(points[f].1, dyaw) + Vec2::new(vx, vz) - points[f].0;
        let mean = (weights[0] * slide(0) + weights[1] * slide(1)) / (weights[0] + weights[1]);
        [vx - most * mean.x, vz - most * mean.y, dyaw]
    }
}

/// `(x, z)` turned by `yaw` about Y.
fn turned(p: Vec2, yaw: f32) -> Vec2 {
    let (s, c) = libm::sincosf(yaw);
    Vec2::new(c * p.x + s * p.y, c * p.y - s * p.x)
}

/// 1 up to the first limit, 0 from the second on, smooth between.
fn fade(value: f32, [full, none]: [f32; 2]) -> f32 {
    let t = ((none - value) / (none - full)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

trait Floor {
    fn xz_plane(self) -> Vec2;
}

impl Floor for Vec3 {
    fn xz_plane(self) -> Vec2 {
        Vec2::new(self.x, self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Root;

    /// Joints of a rig at rest whose feet are given as seen from `root`: `[left, right]`, world.
    fn standing(rig: &Rig, root: &Root, feet: [Vec3; 2]) -> Vec<Transform> {
        let mut joints = vec![Transform::IDENTITY; rig.len()];
        for (foot, names) in feet.iter().zip([["leftFoot", "leftToes"], ["rightFoot", "rightToes"]]) {
            let rest = |name: &str| {
                let chain = std::iter::successors(rig.index(name), |&j| rig.joints[j].parent);
                chain.map(|j| rig.joints[j].offset[1]).sum::<f32>()
            };
            for (name, ahead) in names.iter().zip([0.0, 0.13]) {
                let world = *foot + Vec3::new(0.0, rest(name), ahead);
                joints[rig.index(name).unwrap()].position = root.to_local(world);
            }
        }
        joints
    }

    /// Walks `decoded` roots (world) while the feet stay at `feet`; returns the corrected root's way.
    fn follow(decoded: &[Root], feet: impl Fn(usize) -> [Vec3; 2]) -> Vec<Root> {
        let rig = Rig::humanoid();
        let mut stance = Stance::new(&rig);
        let mut root = decoded[0];
        stance.correct(&standing(&rig, &decoded[0], feet(0)), [0.0; 3]);
        let mut way = vec![root];
        for (i, pair) in decoded.windows(2).enumerate() {
            let local = pair[0].to_local(Vec3::new(pair[1].x as f32, 0.0, pair[1].z as f32));
            let slip = [0.002, 0.0, 0.004];
            let step = [local.x + slip[0], local.z, (pair[1].yaw - pair[0].yaw) as f32 + slip[2]];
            let [vx, vz, dyaw] = stance.correct(&standing(&rig, &pair[1], feet(i + 1)), step);
            root = root.advanced(vx, vz, dyaw);
            way.push(root);
        }
        way
    }

    fn sway(frames: usize) -> Vec<Root> {
        let at = |i: usize| (i as f64 * 0.2).sin();
        (0..frames).map(|i| Root { x: 0.03 * at(i), z: -0.02 * at(i), yaw: 0.5 + 0.1 * at(i) }).collect()
    }

    #[test]
    fn planted_feet_stay_though_the_decoded_root_slips() {
        let feet = [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.0, 0.05)];
        let true_way = sway(300);
        // Each decoded step is 2 mm and 0.23 degrees off: 60 cm and 69 degrees over these ten seconds.
        for (a, b) in follow(&true_way, |_| feet).iter().zip(&true_way) {
            assert!((a.x - b.x).hypot(a.z - b.z) < 1e-4, "{a:?} {b:?}");
            assert!((a.yaw - b.yaw).abs() < 1e-4, "{a:?} {b:?}");
        }
    }

    #[test]
    fn one_planted_foot_holds_the_place() {
        let lifted = [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.3, 0.0)];
        let way = follow(&sway(100), |_| lifted);
        // The heading is not known from one foot and drifts; the standing foot stays: its distance from the root does.
        for (a, b) in way.iter().zip(&sway(100)) {
            let from = |r: &Root| (r.x - 0.1).hypot(r.z);
            assert!((from(a) - from(b)).abs() < 2e-3, "{a:?} {b:?}");
        }
    }

    #[test]
    fn feet_in_the_air_or_swinging_say_nothing() {
        let true_way = sway(50);
        let drift = |way: Vec<Root>| way.last().unwrap().yaw - true_way.last().unwrap().yaw;
        let jump = follow(&true_way, |_| [Vec3::new(0.1, 0.2, 0.0), Vec3::new(-0.1, 0.2, 0.0)]);
        assert!((drift(jump) - 49.0 * 0.004).abs() < 1e-4, "decoded steps as they are");
        let swing = follow(&true_way, |i| {
            let z = if i % 2 == 0 { 0.0 } else { 0.1 };
            [Vec3::new(0.1, 0.0, z), Vec3::new(-0.1, 0.0, z)]
        });
        assert!((drift(swing) - 49.0 * 0.004).abs() < 1e-4, "3 m/s is no stance");
    }
}
