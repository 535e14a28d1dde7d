//! Bone lengths of decoded poses against the rig's.

use glam::Vec3;
use serde::Serialize;
use visavis::{Frame, Rig};

/// By how much decoded bones differ from the rig's, relative to the bone's length (0.01 is 1 %).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BoneDeviation {
    /// Mean over bones and frames.
    pub mean: f64,
    /// The worst bone in its worst frame.
    pub max: f64,
}

/// Deviation of bone lengths; bones shorter than a millimetre in the rig are left out.
pub fn bone_deviation(rig: &Rig, frames: &[Frame]) -> Option<BoneDeviation> {
    let bones = rig.joints.iter().enumerate().filter_map(|(j, joint)| {
        let length = Vec3::from(joint.offset).length();
        Some((j, joint.parent?, length)).filter(|_| length > 1e-3)
    });
    let bones: Vec<_> = bones.collect();
    let (mut sum, mut max, mut n) = (0.0_f64, 0.0_f64, 0_usize);
    for frame in frames {
        for &(j, parent, length) in &bones {
            let decoded = frame.global[j].position.distance(frame.global[parent].position);
            let deviation = f64::from((decoded - length).abs() / length);
            sum += deviation;
            max = max.max(deviation);
            n += 1;
        }
    }
    (n > 0).then(|| BoneDeviation { mean: sum / n as f64, max })
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    #[test]
    fn at_rest_bones_have_their_length() {
        let r = recording(3, |_, _, _| {});
        close(bone_deviation(&r.rig, &r.frames).unwrap().max, 0.0, 1e-6);
    }

    #[test]
    fn a_neck_stretched_by_a_tenth() {
        let r = recording(4, |i, _, p| p[1].y += if i == 2 { 0.06 } else { 0.0 });
        let deviation = bone_deviation(&r.rig, &r.frames).unwrap();
        close(deviation.max, 0.1, 1e-5);
        close(deviation.mean, 0.1 / (4.0 * 6.0), 1e-6);
    }

    #[test]
    fn no_frames_no_value() {
        assert_eq!(bone_deviation(&recording(0, |_, _, _| {}).rig, &[]), None);
    }
}
