//! The step of the root from the feet that stand.

use super::{Contact, earlier, floor, turn};
use glam::Vec3;

/// The corrected step `(vx, vz, dyaw)` for a decoded one: turned so that the line between two
/// planted feet keeps its direction, then moved so that their weighted mean stays. `before` and
/// `now` are heel and toes of both feet, each in the heading frame of its frame.
pub(super) fn correct(
    contacts: &[Contact; 2],
    before: &[[Vec3; 2]; 2],
    now: &[[Vec3; 2]; 2],
    step: [f32; 3],
) -> [f32; 3] {
    // Each foot's lowest point, on the floor.
    let points = [0, 1].map(|f| (floor(before[f][contacts[f].low]), now[f][contacts[f].low]));
    let slide = |f: usize, step: [f32; 3]| earlier(points[f].1, step) - points[f].0;
    let weights = [0, 1].map(|f| contacts[f].planted(slide(f, step)));
    let most = weights[0].max(weights[1]);
    if most == 0.0 {
        return step;
    }
    let [vx, vz, dyaw] = step;
    let (was, is) = (points[1].0 - points[0].0, earlier(points[1].1, step) - earlier(points[0].1, step));
    let dyaw = dyaw + weights[0].min(weights[1]) * turn(is, was);
    let step = [vx, vz, dyaw];
    let mean = (weights[0] * slide(0, step) + weights[1] * slide(1, step)) / (weights[0] + weights[1]);
    [vx - most * mean.x, vz - most * mean.y, dyaw]
}
