//! Feet: sliding and the speed of the foot that carries.

use super::{RATE, joint, mean, position};
use glam::Vec3;
use visavis::{Frame, Rig};

/// A foot lower than this is near the ground, metres (SARAH 4).
pub const CONTACT_HEIGHT: f64 = 0.05;
/// A foot near the ground that moves faster than this slides, m/s (SARAH 4).
pub const SLIDE_SPEED: f64 = 0.03;

/// The points that stand for one foot: `(joint, its height at rest)`. The rig rests on y = 0.
struct Foot(Vec<(usize, f32)>);

impl Foot {
    fn all(rig: &Rig) -> Vec<Self> {
        let mut heights: Vec<f32> = Vec::with_capacity(rig.joints.len());
        for joint in &rig.joints {
            heights.push(joint.parent.map_or(0.0, |p| heights[p]) + joint.offset[1]);
        }
        let foot = |names: [&str; 2]| {
            Foot(names.iter().filter_map(|name| joint(rig, name)).map(|j| (j, heights[j])).collect())
        };
        let feet = [foot(["leftFoot", "leftToes"]), foot(["rightFoot", "rightToes"])];
        feet.into_iter().filter(|foot| !foot.0.is_empty()).collect()
    }

    /// The foot's lowest point in a frame: `(joint, clearance)`.
    fn lowest(&self, frame: &Frame) -> (usize, f64) {
        let clearances = self.0.iter().map(|&(j, rest)| (j, f64::from(position(frame, j).y - rest)));
        clearances.min_by(|a, b| a.1.total_cmp(&b.1)).expect("a foot has a point")
    }
}

fn horizontal_speed(from: Vec3, to: Vec3) -> f64 {
    f64::from((to.x - from.x).hypot(to.z - from.z)) * RATE
}

/// Clearance of each foot in each frame, metres: `[left, right]`; a foot the rig lacks is
/// infinitely high.
///
/// Ankle and toe joints lie inside the foot, so their height above the floor is taken relative to
/// the rest pose, which stands on the floor; the lower of the two counts, be it heel or toes.
pub fn foot_clearances(rig: &Rig, frames: &[Frame]) -> Vec<[f64; 2]> {
    let points = |names: [&str; 2]| Foot::all(rig).into_iter().find(|foot| Some(foot.0[0].0) == joint(rig, names[0]));
    let feet = [points(["leftFoot", "leftToes"]), points(["rightFoot", "rightToes"])];
    let clearance = |foot: &Option<Foot>, frame| foot.as_ref().map_or(f64::INFINITY, |foot| foot.lowest(frame).1);
    frames.iter().map(|frame| [clearance(&feet[0], frame), clearance(&feet[1], frame)]).collect()
}

/// Share of frames (0 to 1) with a foot below [`CONTACT_HEIGHT`] moving horizontally faster than
/// [`SLIDE_SPEED`].
///
/// The first frame has no speed and does not count.
pub fn foot_slide(rig: &Rig, frames: &[Frame]) -> Option<f64> {
    let feet = Foot::all(rig);
    if feet.is_empty() {
        return None;
    }
    let slides = |pair: &[Frame]| {
        feet.iter().any(|foot| {
            let (j, clearance) = foot.lowest(&pair[1]);
            let speed = horizontal_speed(position(&pair[0], j), position(&pair[1], j));
            clearance < CONTACT_HEIGHT && speed > SLIDE_SPEED
        })
    };
    mean(frames.windows(2).map(|pair| f64::from(u8::from(slides(pair)))))
}

/// Mean horizontal speed of the lower foot, m/s.
pub fn support_foot_speed(rig: &Rig, frames: &[Frame]) -> Option<f64> {
    let feet = Foot::all(rig);
    if feet.is_empty() {
        return None;
    }
    mean(frames.windows(2).map(|pair| {
        let lowest = feet.iter().map(|foot| foot.lowest(&pair[1])).min_by(|a, b| a.1.total_cmp(&b.1));
        let (j, _) = lowest.expect("there is a foot");
        horizontal_speed(position(&pair[0], j), position(&pair[1], j))
    }))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    const LEFT: [usize; 2] = [4, 5];
    const RIGHT: usize = 6;

    #[test]
    fn a_still_agent_does_not_slide() {
        let r = recording(10, |_, _, _| {});
        assert_eq!(foot_slide(&r.rig, &r.frames), Some(0.0));
        assert_eq!(support_foot_speed(&r.rig, &r.frames), Some(0.0));
        assert!(foot_clearances(&r.rig, &r.frames).iter().all(|c| c[0].abs() < 1e-6 && c[1].abs() < 1e-6));
    }

    #[test]
    fn slides_for_half_of_the_frames() {
        // 41 frames, 40 steps: 20 at 5 cm/s, then still.
        let r = recording(41, |i, _, p| LEFT.iter().for_each(|&j| p[j].x += i.min(20) as f32 * 0.05 / 30.0));
        close(foot_slide(&r.rig, &r.frames).unwrap(), 0.5, 1e-9);
    }

    #[test]
    fn a_slow_or_lifted_foot_does_not_slide() {
        let slow = recording(20, |_, t, p| p[RIGHT].z += 0.025 * t);
        assert_eq!(foot_slide(&slow.rig, &slow.frames), Some(0.0));
        let lifted = recording(20, |_, t, p| {
            p[RIGHT].y += 0.06;
            p[RIGHT].z += t;
        });
        assert_eq!(foot_slide(&lifted.rig, &lifted.frames), Some(0.0));
        close(foot_clearances(&lifted.rig, &lifted.frames)[3][1], 0.06, 1e-6);
    }

    #[test]
    fn toes_touch_while_the_heel_is_up() {
        let r = recording(20, |_, t, p| {
            p[RIGHT].y += 0.5;
            p[4].y += 0.1;
            LEFT.iter().for_each(|&j| p[j].x += 0.2 * t);
        });
        assert_eq!(foot_slide(&r.rig, &r.frames), Some(1.0));
        close(support_foot_speed(&r.rig, &r.frames).unwrap(), 0.2, 1e-5);
    }

    #[test]
    fn support_speed_is_the_lower_foots() {
        let r = recording(20, |_, t, p| {
            p[RIGHT].y += 0.2;
            p[RIGHT].x += 3.0 * t;
            LEFT.iter().for_each(|&j| p[j].z += 0.1 * t);
        });
        close(support_foot_speed(&r.rig, &r.frames).unwrap(), 0.1, 1e-5);
    }

    #[test]
    fn nothing_to_measure_is_none() {
        let mut r = recording(1, |_, _, _| {});
        assert_eq!(foot_slide(&r.rig, &r.frames), None);
        r = recording(5, |_, _, _| {});
        r.rig.joints.truncate(4);
        assert_eq!(foot_slide(&r.rig, &r.frames), None);
        assert_eq!(support_foot_speed(&r.rig, &r.frames), None);
    }
}
