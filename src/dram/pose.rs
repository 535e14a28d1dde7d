//! Pose vectors y `[D]` to joints and back.
//!
//! `vx, vz, dyaw` (the root's step since the frame before in that frame's heading frame, m and
//! rad), the height of the hips (m), then of each joint the first two columns of its local rotation
//! matrix; the hips' is relative to the heading. Bones have the rig's length.

use crate::frame::Transform;
use crate::rig::Rig;
use glam::{Mat3, Quat, Vec3};

/// Numbers before the joints.
pub const LEAD: usize = 4;
/// Numbers of a joint.
pub(super) const SIX: usize = 6;

/// Length D of the pose vector of `joints` joints.
pub const fn pose_size(joints: usize) -> usize {
    LEAD + SIX * joints
}

/// The rig's bones.
#[derive(Debug)]
pub struct Bones {
    parents: Vec<Option<usize>>,
    offsets: Vec<Vec3>,
}

impl Bones {
    /// Those of `rig`.
    pub fn new(rig: &Rig) -> Self {
        Self {
            parents: rig.joints.iter().map(|joint| joint.parent).collect(),
            offsets: (0..rig.len()).map(|j| rig.offset(j)).collect(),
        }
    }

    /// Number of joints.
    pub(super) fn count(&self) -> usize {
        self.parents.len()
    }

    /// Joints of pose `y` in its heading frame.
    ///
    /// # Panics
    /// When lengths are not those of the rig.
    pub fn place(&self, y: &[f32], joints: &mut [Transform]) {
        assert!(joints.len() == self.count() && y.len() == pose_size(self.count()), "a pose of this rig");
        let sixes = y[LEAD..].as_chunks::<SIX>().0;
        for (j, six) in sixes.iter().enumerate() {
            let (x, y_axis) = (Vec3::from_slice(&six[..3]), Vec3::from_slice(&six[3..]));
            let local = Quat::from_mat3(&Mat3::from_cols(x, y_axis, x.cross(y_axis))).normalize();
            joints[j] = match self.parents[j] {
                None => Transform { position: Vec3::new(0.0, y[3], 0.0), rotation: local },
                Some(parent) => {
                    let Transform { position, rotation } = joints[parent];
                    Transform {
                        position: position + rotation * self.offsets[j],
                        rotation: (rotation * local).normalize(),
                    }
                }
            };
        }
    }

    /// The pose vector of `joints` in their heading frame, reached by `step`.
    ///
    /// # Panics
    /// As [`Bones::place`].
    pub fn read(&self, joints: &[Transform], step: [f32; 3], y: &mut [f32]) {
        assert!(joints.len() == self.count() && y.len() == pose_size(self.count()), "a pose of this rig");
        let (lead, sixes) = y.split_at_mut(LEAD);
        lead[..3].copy_from_slice(&step);
        lead[3] = joints[0].position.y;
        for (j, six) in sixes.as_chunks_mut::<SIX>().0.iter_mut().enumerate() {
            let parent = self.parents[j].map_or(Quat::IDENTITY, |p| joints[p].rotation);
            let local = Mat3::from_quat((parent.inverse() * joints[j].rotation).normalize());
            six[..3].copy_from_slice(&local.x_axis.to_array());
            six[3..].copy_from_slice(&local.y_axis.to_array());
        }
    }
}

/// Makes the columns of each joint of pose `y` orthonormal (Gram-Schmidt).
pub(super) fn orthonormalise(y: &mut [f32]) {
    let unit = |v: Vec3| v / (v.dot(v) + 1e-12).sqrt();
    for six in y[LEAD..].as_chunks_mut::<SIX>().0 {
        let a = unit(Vec3::from_slice(&six[..3]));
        let b = Vec3::from_slice(&six[3..]);
        let b = unit(b - a.dot(b) * a);
        six[..3].copy_from_slice(&a.to_array());
        six[3..].copy_from_slice(&b.to_array());
    }
}

/// Mean of `delta` `[D]` for each joint; the root's numbers count with the hips.
pub(super) fn per_joint(delta: &[f32], joints: &mut [f32]) {
    let (lead, sixes) = delta.split_at(LEAD);
    for (j, (mean, six)) in joints.iter_mut().zip(sixes.as_chunks::<SIX>().0).enumerate() {
        let (sum, count) = (six.iter().sum::<f32>(), SIX as f32);
        *mean = if j == 0 { (sum + lead.iter().sum::<f32>()) / (count + LEAD as f32) } else { sum / count };
    }
}
