//! The skeleton of a bundle.

use serde::{Deserialize, Serialize};

/// One joint of a [`Rig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// VRM humanoid bone name.
    pub name: String,
    /// Index of the parent, smaller than the joint's own; `None` for the hips.
    pub parent: Option<usize>,
    /// Rest offset from the parent, metres; for the hips their height above the floor.
    pub offset: [f32; 3],
}

/// The skeleton: joints with parents before children. At rest it stands in a T-pose facing +Z, all rotations identity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// Joints, parents before children.
    pub joints: Vec<Joint>,
    /// Midpoint of the eyes in the head joint's frame, metres (the front of the head, `h_f`).
    pub eyes: [f32; 3],
    /// Back of the head in the head joint's frame, metres (`h_b`).
    pub head_back: [f32; 3],
}
