#![doc = include_str!("../docs/crate.md")]
//! # Names
//!
//! - a bundle: [`Engine`], [`Networks`], [`BundleFile`], [`LoadMode`]; its skeleton [`Rig`],
//!   [`Joint`], and [`openxr`]'s
//! - a conversation: [`Session`], [`SessionOptions`], [`Sampler`], [`EulerSteps`], [`Governor`],
//!   [`Budget`]; several: [`Team`]
//! - other threads: [`VoiceInput`], [`Speaker`], [`HeadInput`], [`SoundInput`], [`Controls`], [`SharedSession`],
//!   [`threads`]
//! - what comes out: [`Frame`], [`Root`], [`Transform`]; vectors and rotations of `glam`
//! - constants: [`FPS`], [`BLOCK_FRAMES`], [`SAMPLE_RATE`]
//! - what happened: [`stats`], [`replay`]; [`Error`], [`ErrorKind`], [`Result`]
#![cfg_attr(visavis_rtsan, feature(sanitize))]
#![cfg_attr(
    not(feature = "internals"),
    allow(unused_imports, reason = "rooms show the tools more than the library itself uses")
)]

mod audio;
mod bounded;
mod bundle;
mod clock;
mod config;
mod dram;
mod engine;
mod error;
mod flow;
mod frame;
mod hearing;
#[allow(unsafe_code, reason = "SIMD loads, stores and inline assembly")]
#[cfg_attr(feature = "kernel-tests", allow(unused, reason = "tests without their harness"))]
mod kernels;
#[cfg(feature = "internals")]
mod mospa;
mod nn;
mod normaliser;
#[allow(unsafe_code, reason = "the fork-join pool hands slices to its worker")]
mod par;
mod pose;
#[cfg(feature = "quant")]
mod quant;
mod queue;
mod rig;
mod scheme;
mod session;
mod user;
mod vae;

pub use audio::{Speaker, VoiceInput};
pub use bundle::{BundleFile, LoadMode};
pub use engine::{Engine, Networks};
pub use error::{Error, ErrorKind, Result};
pub use frame::{BLOCK_FRAMES, EulerSteps, FPS, Frame, Root, SAMPLE_RATE, Sampler, Transform};
pub use glam;
pub use hearing::SoundInput;
pub use rig::{Joint, Rig};
pub use session::{Budget, Controls, Governor, Session, SessionOptions, SharedSession, Team};
pub use user::HeadInput;

/// What a session counts and measures ([`Session::stats`]).
pub mod stats {
    pub use crate::audio::VoiceStats;
    pub use crate::hearing::SoundStats;
    pub use crate::pose::GuardStats;
    pub use crate::session::{Delays, GovernorStats, InputStats, SessionStats};
    pub use crate::user::TrackStats;
}

/// The governor's decisions, to record and to replay.
///
/// [`Session::decisions`] records them, [`Governor::Replay`] goes by them.
pub mod replay {
    pub use crate::session::{Decision, Hold, Plan};
}

/// The rig's joints as OpenXR's body tracking extensions number them.
pub mod openxr {
    pub use crate::pose::openxr::{FB_BODY_JOINTS, OPENXR_JOINTS, openxr_joint};
}

/// The thread that polls: its kernel id, and the cores it may run on.
pub mod threads {
    pub use crate::par::{current_thread_id, pin_current_thread};
}

/// The rooms of this crate, for its own tools, tests, benchmarks and fuzz targets. Nothing in here
/// keeps its shape from one version to the next, patches included.
#[cfg(feature = "internals")]
#[doc(hidden)]
pub mod internals {
    macro_rules! rooms {
        ($($room:ident)*) => { $(pub mod $room { pub use crate::$room::*; })* };
    }

    rooms!(audio bounded bundle config dram engine flow frame hearing kernels mospa nn normaliser par pose session user vae);
    #[cfg(feature = "quant")]
    rooms!(quant);
}

/// The README's example compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
