//! Gaze score and its mean over a recording ("head angle").

use super::{joint, mean};
use crate::recording::Recording;
use glam::Vec3;
use visavis::{Frame, Rig};

/// Gaze score of a frame, -1 to 1 (SARAH 3.4): `unit(h_f - h_b) . unit(user - h_b)`.
///
/// `h_f` and `h_b` are the rig's [`eyes`](Rig::eyes) and [`head_back`](Rig::head_back) carried
/// along by the decoded head joint; `user` is the world position of the user's head. `None` when
/// the rig has no head or a direction has no length.
pub fn gaze_score(rig: &Rig, frame: &Frame, user: Vec3) -> Option<f64> {
    let head = frame.global[joint(rig, "head")?];
    let at = |offset: [f32; 3]| head.position + head.rotation * Vec3::from(offset);
    let back = at(rig.head_back);
    let facing = (at(rig.eyes) - back).try_normalize()?;
    let toward = (user - back).try_normalize()?;
    Some(f64::from(facing.dot(toward).clamp(-1.0, 1.0)))
}

/// Gaze score of every frame; `None` where the user's position is not known.
pub fn gaze_scores(recording: &Recording) -> Vec<Option<f64>> {
    let pairs = recording.frames.iter().zip(&recording.user);
    pairs.map(|(frame, user)| gaze_score(&recording.rig, frame, (*user)?)).collect()
}

/// Mean gaze score over the frames in which the user's position is known.
pub fn head_angle(recording: &Recording) -> Option<f64> {
    mean(gaze_scores(recording).into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;
    use glam::Quat;

    /// The back of the testing rig's head is at (0, 1.6, -0.1), facing +Z.
    const BACK: Vec3 = Vec3::new(0.0, 1.6, -0.1);

    #[test]
    fn facing_aside_and_away() {
        let r = recording(1, |_, _, _| {});
        for (user, score) in [
            (Vec3::new(0.0, 0.0, 2.0), 1.0),
            (Vec3::new(3.0, 0.0, 0.0), 0.0),
            (Vec3::new(0.0, 0.0, -1.0), -1.0),
            (Vec3::new(1.0, 0.0, 1.0), 0.5_f64.sqrt()),
            (Vec3::new(0.0, 1.0, 1.0), 0.5_f64.sqrt()),
        ] {
            close(gaze_score(&r.rig, &r.frames[0], BACK + user).unwrap(), score, 1e-5);
        }
        assert_eq!(gaze_score(&r.rig, &r.frames[0], BACK), None);
    }

    #[test]
    fn the_head_turns_the_gaze() {
        let mut r = recording(1, |_, _, _| {});
        r.frames[0].global[1].rotation = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        // Facing +X, the back of the head lies at (-0.1, 1.6, 0).
        close(gaze_score(&r.rig, &r.frames[0], Vec3::new(4.0, 1.6, 0.0)).unwrap(), 1.0, 1e-5);
    }

    #[test]
    fn frames_without_a_user_do_not_count() {
        let mut r = recording(3, |_, _, _| {});
        assert_eq!(head_angle(&r), None);
        r.user[0] = Some(BACK + Vec3::Z);
        r.user[2] = Some(BACK + Vec3::X);
        close(head_angle(&r).unwrap(), 0.5, 1e-5);
        assert_eq!(gaze_scores(&r)[1], None);
    }
}
