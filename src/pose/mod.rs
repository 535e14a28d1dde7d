//! Poses: the rig, icosahedra, and the way between feature vectors and joint transforms.
//!
//! A pose enters as one feature vector `x` of `3 + 36 J` values (see [`Decoder`]), becomes a world
//! transform of each joint ([`crate::frame::Frame::global`]) and, because decoded joints do not
//! keep bone lengths exactly, a rotation of each joint on the rig that does ([`Fit`],
//! [`crate::frame::Frame::local`]). The difference is reported in
//! [`crate::frame::Frame::fit_error`]. [`Encoder`] is the way back.
//!
//! Everything is right-handed, metres, Y up; nothing here allocates once it is built.

mod bridge;
#[cfg(feature = "internals")]
mod encoder;
mod features;
mod fit;
mod gaze;
mod guard;
pub mod icosahedron;
pub mod openxr;
mod stance;
#[cfg(feature = "internals")]
pub mod synthetic;

pub use crate::frame::feature_count;
pub use crate::rig::{Joint, MAX_JOINTS, Rig};
#[cfg(feature = "internals")]
pub use encoder::{Encoder, root_of};
pub use features::Decoder;
pub use fit::Fit;
pub use gaze::gaze_score;
pub use guard::{
    DEFECTIVE_HELD, DEFECTIVE_TRIPS_A_MINUTE, GuardStats, MAX_JOINT_SPEED, MAX_ROOT_SPEED, MAX_TURN_SPEED,
};
