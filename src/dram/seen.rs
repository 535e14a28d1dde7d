//! What is known of the user in a frame.

use crate::frame::Root;
use glam::{Quat, Vec3};

/// Numbers of the user's row.
pub const USER: usize = 12;

/// The user's head in one frame, and the gaze that is wanted there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Seen {
    /// Where the head is in the world, metres.
    pub head: Option<Vec3>,
    /// How it is turned in the world (identity: facing +Z); nothing without a position.
    pub rotation: Option<Quat>,
    /// Wanted gaze score.
    pub gaze: Option<f32>,
}

impl Seen {
    /// The row of the predictor, in the heading frame of `root`: place (near numbers and
    /// direction), where the face points, and for each whether it is known; what is not is 0.
    pub(super) fn row(&self, root: &Root) -> [f32; USER] {
        let mut row = [0.0; USER];
        if let Some(head) = self.head {
            let Vec3 { x, y, z } = root.to_local(head);
            let far = (x * x + z * z + 0.01).sqrt();
            row[..5].copy_from_slice(&[x / 2.0, z / 2.0, y - 1.6, x / far, z / far]);
            row[8] = 1.0;
            if let Some(rotation) = self.rotation {
                let face = rotation * Vec3::Z;
                let (s, c) = libm::sincosf(root.yaw as f32);
                row[5..8].copy_from_slice(&[c * face.x - s * face.z, face.y, s * face.x + c * face.z]);
                row[9] = 1.0;
            }
        }
        if let Some(gaze) = self.gaze {
            (row[10], row[11]) = (gaze, 1.0);
        }
        row
    }
}
