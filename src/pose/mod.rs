//! Poses: the rig, icosahedra, and the way between feature vectors and joint transforms.

mod rig;
pub use rig::{Joint, Rig};
