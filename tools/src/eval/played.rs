//! Motion as it is played: on the rig, whose bones keep their length.

use crate::metrics::bone_deviation;
use visavis::internals::kernels::Kernels;
use visavis::internals::pose::{Fit, root_of};
use visavis::{FPS, Frame, Result, Rig};

/// Joints this near to where the rig has them stand on it, metres: f32 in a file, not a bone.
const ON_RIG: f32 = 1e-4;

/// A motion in a window, as it is measured and kept.
///
/// Decoded joints stand a few millimetres off the rig's, and the decoded root off the hips, which
/// nobody who sees the rig sees. So each motion is that of the rig's joints, over the root that is
/// the floor under their hips, whoever made it.
#[derive(Debug, Clone)]
pub(super) struct Played {
    pub(super) frames: Vec<Frame>,
    /// Mean deviation of bone lengths before the fit, relative.
    pub(super) bones: Option<f64>,
}

impl Played {
    /// A recording, as it is.
    pub(super) fn recorded(rig: &Rig, frames: Vec<Frame>) -> Self {
        let bones = bone_deviation(rig, &frames).map(|deviation| deviation.mean);
        Self { frames, bones }
    }

    /// Motion of the runtime, which has fitted the rig.
    pub(super) fn shown(rig: &Rig, frames: Vec<Frame>) -> Self {
        let mut this = Self::recorded(rig, frames);
        for (i, frame) in this.frames.iter_mut().enumerate() {
            // Blocks begin at multiples of four, here and where a window begins in a session.
            (frame.index, frame.time) = (i as u64, i as f64 / f64::from(FPS));
            rig.fk(frame.hips, &frame.local, &mut frame.global);
            frame.root = root_of(&frame.global[0], frame.root.yaw);
        }
        this
    }

    /// Joints from elsewhere, through the runtime's fit unless they stand on the rig. A straight
    /// leg has no leverage: the fit would move its foot by 20 um to and fro, and a standing foot by
    /// half a millimetre a second.
    ///
    /// # Errors
    /// Those of choosing kernels for this CPU.
    pub(super) fn fitted(rig: &Rig, mut frames: Vec<Frame>) -> Result<Self> {
        if frames.iter().all(|frame| on_rig(rig, frame)) {
            return Ok(Self::recorded(rig, frames));
        }
        let mut fit = Fit::new(Kernels::detect()?, rig);
        frames.iter_mut().for_each(|frame| fit.fit(frame));
        Ok(Self::shown(rig, frames))
    }
}

/// Whether each joint is where its parent's rotation puts it.
fn on_rig(rig: &Rig, frame: &Frame) -> bool {
    rig.joints.iter().zip(&frame.global).enumerate().all(|(j, (joint, at))| {
        let place = joint.parent.map(|p| frame.global[p].position + frame.global[p].rotation * rig.offset(j));
        place.is_none_or(|place| place.distance(at.position) < ON_RIG)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic;
    use visavis::glam::{Quat, Vec3};

    #[test]
    fn joints_from_elsewhere_are_put_on_the_rig() {
        let recording = synthetic::walk(60);
        let rig = &recording.rig;
        let apart = |a: &[Frame], b: &[Frame]| {
            let joints = a.iter().zip(b).flat_map(|(a, b)| a.global.iter().zip(&b.global));
            joints.map(|(a, b)| a.position.distance(b.position)).fold(0.0, f32::max)
        };
        let same = Played::fitted(rig, recording.frames.clone()).unwrap();
        assert!(apart(&same.frames, &recording.frames) == 0.0 && same.bones.unwrap() < 1e-5);

        let mut off = recording.frames.clone();
        for (i, frame) in off.iter_mut().enumerate() {
            for (j, joint) in frame.global.iter_mut().enumerate() {
                let way = Vec3::new((i + 3 * j) as f32, (7 * j) as f32, (2 * i + j) as f32);
                joint.position += 0.004 * Vec3::new(way.x.sin(), way.y.cos(), way.z.sin());
                joint.rotation = Quat::from_rotation_y(0.01 * way.z.sin()) * joint.rotation;
            }
            frame.root = Default::default();
        }
        let fitted = Played::fitted(rig, off.clone()).unwrap();
        assert!(fitted.bones.unwrap() > 0.005, "bones as they came: {:?}", fitted.bones);
        let kept = Played::recorded(rig, fitted.frames.clone());
        assert!(kept.bones.unwrap() < 1e-5, "and as they are played: {:?}", kept.bones);
        assert!(apart(&fitted.frames, &off) < 0.03, "near where they were: {}", apart(&fitted.frames, &off));
        for frame in &fitted.frames {
            let (root, hips) = (frame.root, frame.global[0].position);
            assert_eq!([root.x as f32, root.z as f32], [hips.x, hips.z], "the root is under the hips");
        }
    }
}
