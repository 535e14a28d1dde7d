//! The gaze score.

use super::Rig;
use crate::frame::Transform;
use glam::Vec3;

/// How much the head is turned towards the user: `g = unit(h_f - h_b) . unit(user - h_b)` with
/// `h_f` the eyes' midpoint and `h_b` the back of the head (SARAH 3.4), in three dimensions.
///
/// `head` is the head joint's transform and `user` the user's head, both in the same frame, metres.
/// 1: faced, 0: at a right angle, -1: turned away. `None` where there is no direction: the user's
/// head within 1 mm of `h_b`, or a value that is not finite.
pub fn gaze_score(rig: &Rig, head: &Transform, user: Vec3) -> Option<f32> {
    let (front, back) = rig.head_points(head);
    let to_user = user - back;
    let looks = (front - back).try_normalize()?;
    let g = looks.dot(to_user.try_normalize()?);
    (to_user.length() > 1e-3 && g.is_finite()).then(|| g.clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn faced_sideways_and_away() {
        let rig = Rig::humanoid();
        let turn = std::f32::consts::FRAC_PI_2;
        let head = |yaw: f32| Transform { position: Vec3::new(0.0, 1.5, 0.0), rotation: Quat::from_rotation_y(yaw) };
        // Level with the eyes and 2 m ahead of the back of the head.
        let user = Vec3::new(0.0, 1.57, 1.90);
        assert!((gaze_score(&rig, &head(0.0), user).unwrap() - 1.0).abs() < 1e-6);
        assert!(gaze_score(&rig, &head(turn), user).unwrap().abs() < 0.06);
        assert!(gaze_score(&rig, &head(2.0 * turn), user).unwrap() < -0.99);
        let diagonal = Vec3::new(2.0, 1.57, -0.10 + 2.0);
        assert!((gaze_score(&rig, &head(0.0), diagonal).unwrap() - 0.5f32.sqrt()).abs() < 1e-6);
        assert_eq!(gaze_score(&rig, &head(0.0), Vec3::new(0.0, 1.57, -0.10)), None);
        assert_eq!(gaze_score(&rig, &head(0.0), Vec3::new(f32::NAN, 0.0, 0.0)), None);
    }
}
