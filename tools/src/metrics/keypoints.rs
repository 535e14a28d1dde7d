//! Distances to a ground truth: APE and PCK.

use super::mean;
use glam::Vec3;
use visavis::{Error, ErrorKind, Frame, Result};

/// Where positions are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// In the world: where the agent stands counts.
    World,
    /// Each in its own root's heading frame: only the pose counts.
    Root,
}

impl Space {
    fn position(self, frame: &Frame, j: usize) -> Vec3 {
        match self {
            Self::World => frame.global[j].position,
            Self::Root => frame.root.to_local(frame.global[j].position),
        }
    }
}

/// Average position error of each joint, metres (DRAM eq. 10): mean over frames of `|predicted -
/// true|`.
///
/// # Errors
/// [`ErrorKind::Argument`] when the sequences differ in length or joints, or are empty.
pub fn ape(predicted: &[Frame], truth: &[Frame], space: Space) -> Result<Vec<f64>> {
    per_joint(predicted, truth, space, |distance| distance)
}

/// Probability of correct keypoints of each joint, 0 to 1 (DRAM eq. 11): share of frames with
/// `|predicted - true| <= sigma` (metres).
///
/// # Errors
/// As [`ape`].
pub fn pck(predicted: &[Frame], truth: &[Frame], sigma: f64, space: Space) -> Result<Vec<f64>> {
    per_joint(predicted, truth, space, |distance| f64::from(u8::from(distance <= sigma)))
}

fn per_joint(predicted: &[Frame], truth: &[Frame], space: Space, value: impl Fn(f64) -> f64) -> Result<Vec<f64>> {
    let joints = truth.first().map_or(0, |frame| frame.global.len());
    let same = predicted.len() == truth.len()
        && joints > 0
        && predicted.iter().chain(truth).all(|frame| frame.global.len() == joints);
    if !same {
        let message = format!(
            "APE and PCK compare frame by frame, but got {} predicted and {} true frames (or other joints): give two \
             sequences of the same frames on the same rig",
            predicted.len(),
            truth.len()
        );
        return Err(Error::new(ErrorKind::Argument, message));
    }
    let joint = |j: usize| {
        let distances = predicted.iter().zip(truth).map(|(p, t)| space.position(p, j).distance(space.position(t, j)));
        mean(distances.map(|d| value(f64::from(d)))).unwrap_or(0.0)
    };
    Ok((0..joints).map(joint).collect())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    #[test]
    fn a_hand_that_is_off_in_one_frame_of_four() {
        let truth = recording(4, |_, _, _| {});
        let other = recording(4, |i, _, p| p[2].y += if i == 1 { 0.2 } else { 0.0 });
        let errors = ape(&other.frames, &truth.frames, Space::World).unwrap();
        close(errors[2], 0.05, 1e-6);
        close(errors.iter().sum(), 0.05, 1e-6);
        let correct = |sigma| pck(&other.frames, &truth.frames, sigma, Space::World).unwrap();
        assert_eq!(correct(0.1)[2], 0.75);
        assert_eq!(correct(0.25)[2], 1.0);
        assert_eq!(correct(0.1)[0], 1.0);
    }

    #[test]
    fn standing_elsewhere_counts_in_the_world_only() {
        let truth = recording(2, |_, _, _| {});
        let mut other = recording(2, |_, _, p| p.iter_mut().for_each(|p| p.x += 3.0));
        assert!(ape(&other.frames, &truth.frames, Space::World).unwrap().iter().all(|&e| (e - 3.0).abs() < 1e-5));
        assert!(ape(&other.frames, &truth.frames, Space::Root).unwrap().iter().all(|&e| e < 1e-5));
        // A quarter turn of the root: the left hand, 0.7 m to the left, is where forward would be.
        other.frames.iter_mut().for_each(|f| f.root.yaw = std::f64::consts::FRAC_PI_2);
        close(ape(&other.frames, &truth.frames, Space::Root).unwrap()[2], 0.7 * 2_f64.sqrt(), 1e-5);
    }

    #[test]
    fn unequal_lengths_are_refused() {
        let (a, b) = (recording(2, |_, _, _| {}), recording(3, |_, _, _| {}));
        assert_eq!(ape(&a.frames, &b.frames, Space::World).unwrap_err().kind(), ErrorKind::Argument);
        assert_eq!(pck(&[], &[], 0.1, Space::Root).unwrap_err().kind(), ErrorKind::Argument);
    }
}
