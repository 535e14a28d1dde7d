//! World transforms to feature vectors: the way back, for tools and tests.

use super::icosahedron::encode;
use crate::frame::{JOINT_CHANNELS, ROOT_CHANNELS, Root, Transform, feature_count};
use crate::normaliser::Metric;
use glam::Vec3;

/// The root of a body whose hips are at `hips` (world): floor projection of the hips, heading of
/// their +Z axis.
///
/// Hips whose +Z axis is upright (within 0.6 degrees) have no heading; they get `yaw`, best that of
/// the frame before.
pub fn root_of(hips: &Transform, yaw: f64) -> Root {
    let z = hips.rotation * Vec3::Z;
    let upright = libm::hypotf(z.x, z.z) < 0.01;
    let yaw = if upright { yaw } else { libm::atan2(f64::from(z.x), f64::from(z.z)) };
    Root { x: f64::from(hips.position.x), z: f64::from(hips.position.z), yaw }
}

/// The way back: world transforms of consecutive frames to feature vectors.
///
/// With the roots that a [`Decoder`](super::Decoder) gave, it returns what the decoder was given,
/// vertices made rigid.
#[derive(Debug, Clone)]
pub struct Encoder {
    radius: f32,
    previous: Option<Root>,
}

impl Encoder {
    /// An encoder with icosahedra of circumradius `radius`, metres. Its first frame has root
    /// channels 0.
    pub fn new(radius: f32) -> Self {
        Self { radius, previous: None }
    }

    /// Starts again; `previous` is the root of the frame before the next, if there is one.
    pub fn reset(&mut self, previous: Option<Root>) {
        self.previous = previous;
    }

    /// Writes the feature vector of the next frame, whose root is `root` ([`root_of`], or
    /// [`Frame::root`](crate::frame::Frame::root)) and whose joints stand at `global` (world, J of
    /// them), to `x`.
    ///
    /// # Panics
    /// If `x` is not `3 + 36 J` long.
    pub fn encode(&mut self, root: Root, global: &[Transform], mut x: Metric<&mut [f32]>) {
        let x = x.values_mut();
        assert_eq!(x.len(), feature_count(global.len()), "a feature vector has 3 + 36 J values");
        let (head, joints) = x.split_at_mut(ROOT_CHANNELS);
        head.copy_from_slice(&step(self.previous.unwrap_or(root), root));
        let heading = root.rotation().inverse();
        for (joint, vertices) in global.iter().zip(joints.as_chunks_mut::<JOINT_CHANNELS>().0) {
            let local = Transform { position: root.to_local(joint.position), rotation: heading * joint.rotation };
            encode(&local, self.radius, vertices);
        }
        self.previous = Some(root);
    }
}

/// `(vx, vz, dyaw)` from one root to the next: the inverse of [`Root::advanced`].
fn step(from: Root, to: Root) -> [f32; 3] {
    let (s, c) = libm::sincos(from.yaw);
    let (x, z) = (to.x - from.x, to.z - from.z);
    let turn = std::f64::consts::TAU;
    let dyaw = to.yaw - from.yaw;
    [c * x - s * z, s * x + c * z, dyaw - turn * (dyaw / turn).round()].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn root_channels_are_in_the_previous_heading_frame() {
        let [from, to] = [Root { x: 5.0, z: 1.0, yaw: 3.1 }, Root { x: 5.2, z: 0.9, yaw: -3.1 }];
        let [vx, vz, dyaw] = step(from, to);
        assert!((dyaw - (std::f32::consts::TAU - 6.2)).abs() < 1e-6, "the short way round, not {dyaw}");
        let again = from.advanced(vx, vz, dyaw);
        assert!((again.x - to.x).abs() < 1e-7 && (again.z - to.z).abs() < 1e-7 && (again.yaw - to.yaw).abs() < 1e-6);
        // One step ahead while facing +X goes along +X.
        let east = Root { x: 0.0, z: 0.0, yaw: std::f64::consts::FRAC_PI_2 };
        let ahead = east.advanced(0.0, 1.0, 0.0);
        assert!((ahead.x - 1.0).abs() < 1e-12 && ahead.z.abs() < 1e-12);
    }

    #[test]
    fn heading_of_lying_hips_is_the_one_before() {
        let lying = Transform { position: Vec3::Y, rotation: Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2) };
        assert_eq!(root_of(&lying, 0.7).yaw, 0.7);
        let leaning =
            Transform { position: Vec3::X, rotation: Quat::from_rotation_y(1.0) * Quat::from_rotation_x(-1.2) };
        assert!((root_of(&leaning, 0.7).yaw - 1.0).abs() < 1e-6);
        assert_eq!(root_of(&leaning, 0.7).x, 1.0);
    }
}
