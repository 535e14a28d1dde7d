//! A runtime that gives a virtual agent a body: full-body motion that talks, listens, turns to the
//! person in front of it and keeps as much eye contact as it is told to.
//!
//! It hears the agent's and the user's voice, sees where the user's head is, and streams poses at
//! 30 frames a second: causal, offline, on one or two CPU cores.
//!
//! ```no_run
//! use visavis::{Engine, SessionOptions};
//!
//! # fn main() -> visavis::Result<()> {
//! let engine = Engine::load("models/visavis-base-i8.safetensors")?; // immutable, shared by any number of sessions
//! let mut session = engine.session(SessionOptions { gaze: Some(0.8), ..Default::default() })?;
//!
//! session.push_agent_audio(&[0.0; 2400], 24_000)?; // as it comes: any chunk size, any rate
//! session.push_user_audio(&[0.0; 480], 48_000)?;
//! session.push_user_head(visavis::glam::Vec3::new(0.3, 1.65, 1.4), 0.0)?; // metres, seconds of session time
//!
//! while let Some(frames) = session.poll(0.0)? {
//!     for frame in frames {
//!         println!("{:.3} s: at ({:.2}, {:.2})", frame.time, frame.root.x, frame.root.z);
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Voices, head positions and settings may come from other threads, by [`Session::voice_input`],
//! [`Session::head_input`] and [`Session::controls`]. Whoever pushes never waits for a block, and
//! the same inputs give the same motion, whichever threads they come from.
#![cfg_attr(visavis_rtsan, feature(sanitize))]
#![cfg_attr(
    not(feature = "internals"),
    allow(dead_code, unused_imports, reason = "what only the tools and tests reach is not taken out one by one")
)]

mod audio;
mod bounded;
mod bundle;
mod config;
mod engine;
mod error;
mod flow;
mod frame;
#[allow(unsafe_code, reason = "SIMD loads, stores and inline assembly")]
mod kernels;
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
pub use rig::{Joint, Rig};
pub use session::{Budget, Controls, Decision, Governor, Hold, Plan, Session, SessionOptions, SharedSession, Team};
pub use user::HeadInput;

/// What a session counts and measures ([`Session::stats`]).
pub mod stats {
    pub use crate::audio::VoiceStats;
    pub use crate::pose::GuardStats;
    pub use crate::session::{Delays, GovernorStats, InputStats, SessionStats};
    pub use crate::user::TrackStats;
}

/// The body joints of OpenXR's tracking extensions, and the rig's joint that each of them follows.
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

    rooms!(audio bounded bundle config engine flow frame kernels nn normaliser par pose session user vae);
    #[cfg(feature = "quant")]
    rooms!(quant);
}
