//! Two bones that reach.

use super::super::fit::swing;
use glam::{Quat, Vec3};

/// No leg is stretched further than this share of its length, unless it was decoded so.
const REACH: f32 = 0.999;
/// A knee nearer than this to the line from hip to ankle has no direction of its own, metres:
/// `forward` takes over.
const STRAIGHT: f32 = 0.01;

/// A leg put where it should be.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// Where the knee is.
    pub(super) knee: Vec3,
    /// Where the ankle is: at the target, or as near as the leg reaches.
    pub(super) ankle: Vec3,
    /// What the upper and the lower leg are turned by.
    pub(super) turns: [Quat; 2],
}

/// Moves the ankle of a leg (`hip`, `knee`, `ankle` as decoded) to `target`, bone lengths as they
/// are. The knee keeps its side, swung along with the leg; a straight leg bends towards `forward`.
/// `None` where a bone has no length.
pub(super) fn reach([hip, knee, ankle]: [Vec3; 3], target: Vec3, forward: Vec3) -> Option<Reach> {
    let (upper, lower, far) = (knee.distance(hip), ankle.distance(knee), ankle.distance(hip));
    let from = (ankle - hip).try_normalize()?;
    let to = (target - hip).try_normalize()?;
    if upper < 1e-4 || lower < 1e-4 {
        return None;
    }
    let longest = far.max(REACH * (upper + lower));
    let shortest = far.min((upper - lower).abs() + (1.0 - REACH) * upper);
    let distance = target.distance(hip).clamp(shortest, longest);

    let side = (knee - hip) - (knee - hip).dot(from) * from;
    let own = (side.length() / STRAIGHT).min(1.0);
    let pole = own * (swing(from, to) * side.normalize_or_zero()) + (1.0 - own) * across(forward, to);
    let pole = across(pole, to);

    // The law of cosines: how far along the line the knee is, and how far off it.
    let along = (upper * upper - lower * lower + distance * distance) / (2.0 * distance);
    let off = (upper * upper - along * along).max(0.0).sqrt();
    let (new_knee, new_ankle) = (hip + along * to + off * pole, hip + distance * to);
    let turns = [swing(knee - hip, new_knee - hip), swing(ankle - knee, new_ankle - new_knee)];
    Some(Reach { knee: new_knee, ankle: new_ankle, turns })
}

/// How low an ankle over the floor point of `target` can be put; not above where it was decoded.
pub(super) fn lowest([hip, knee, ankle]: [Vec3; 3], target: Vec3) -> f32 {
    let longest = ankle.distance(hip).max(REACH * (knee.distance(hip) + ankle.distance(knee)));
    let (x, z) = (target.x - hip.x, target.z - hip.z);
    (hip.y - (longest * longest - x * x - z * z).max(0.0).sqrt()).min(ankle.y)
}

/// The part of `v` at right angles to the unit vector `axis`, as a direction; zero where there is
/// none.
fn across(v: Vec3, axis: Vec3) -> Vec3 {
    (v - v.dot(axis) * axis).normalize_or_zero()
}
