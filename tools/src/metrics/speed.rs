//! Joint speeds: wrists and all joints.

use super::{RATE, joint, mean, position};
use serde::Serialize;
use visavis::{Frame, Rig};

/// Speed of all joints over a recording, world coordinates, m/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointSpeed {
    /// Mean over joints and frames.
    pub mean: f64,
    /// The fastest joint in the fastest frame.
    pub max: f64,
}

/// Mean and maximal joint speed; the first frame has none.
pub fn joint_speed(frames: &[Frame]) -> Option<JointSpeed> {
    let speeds = || {
        frames.windows(2).flat_map(|pair| {
            let joints = pair[0].global.iter().zip(&pair[1].global);
            joints.map(|(a, b)| f64::from(a.position.distance(b.position)) * RATE)
        })
    };
    Some(JointSpeed { mean: mean(speeds())?, max: speeds().fold(0.0, f64::max) })
}

/// Speed of the wrists between each frame and the one before, m/s: the mean of both hand joints,
/// one value less than there are frames. `None` when the rig has no hands.
pub fn wrist_speeds(rig: &Rig, frames: &[Frame]) -> Option<Vec<f64>> {
    let wrists: Vec<usize> = ["leftHand", "rightHand"].iter().filter_map(|name| joint(rig, name)).collect();
    let speed = |pair: &[Frame]| {
        mean(wrists.iter().map(|&j| f64::from(position(&pair[0], j).distance(position(&pair[1], j))) * RATE))
    };
    if wrists.is_empty() { None } else { frames.windows(2).map(speed).collect() }
}

/// Wrist variance as SARAH 4 defines it: mean wrist speed of both wrists, m/s.
///
/// The paper gives no unit with its figures (105.0, ground truth 137.6); millimetres a second, a
/// thousand times this value, is the one in which they are plausible.
pub fn wrist_speed(rig: &Rig, frames: &[Frame]) -> Option<f64> {
    mean(wrist_speeds(rig, frames)?)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    #[test]
    fn one_moving_wrist_gives_half_its_speed() {
        let r = recording(31, |_, t, p| p[2].y += 0.4 * t);
        close(wrist_speed(&r.rig, &r.frames).unwrap(), 0.2, 1e-5);
        let all = joint_speed(&r.frames).unwrap();
        close(all.max, 0.4, 1e-4);
        close(all.mean, 0.4 / 7.0, 1e-5);
    }

    #[test]
    fn a_still_agent_has_speed_zero() {
        let r = recording(5, |_, _, _| {});
        assert_eq!(wrist_speed(&r.rig, &r.frames), Some(0.0));
        assert_eq!(joint_speed(&r.frames), Some(JointSpeed { mean: 0.0, max: 0.0 }));
    }

    #[test]
    fn nothing_to_measure_is_none() {
        let mut r = recording(1, |_, _, _| {});
        assert_eq!(wrist_speed(&r.rig, &r.frames), None);
        assert_eq!(joint_speed(&r.frames), None);
        r = recording(4, |_, _, _| {});
        r.rig.joints.truncate(2);
        assert_eq!(wrist_speeds(&r.rig, &r.frames), None);
    }
}
