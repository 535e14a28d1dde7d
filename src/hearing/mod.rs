//! Sounds in the room: from sources at places to what the agent's two ears hear of them.
//!
//! ```text
//! push: id, f32, ──> SoundInput ────────> Sources ────────> head ────────> Hearing ──────> sound vector
//! any rate, place    resampler, 10 s      16 that sound,    two ears at    encoder,        of a block
//!                    for each of 32       their salience    the agent's    levels, place
//! ```
//!
//! Samples are pascals as they are 1 m from the source: RMS 1 is 94 dB SPL.
//!
//! Beside the sources, what a host's own ears hear (`brought`): added at the ears, and `locate`
//! tells where it comes from.

mod appraisal;
mod brought;
#[cfg(any(test, feature = "internals"))]
mod clip;
mod head;
mod input;
mod listener;
mod locate;
mod sources;
mod stats;

pub use appraisal::AppraisalWeights;
#[cfg(feature = "internals")]
pub use clip::locate;
pub use input::SoundInput;
pub use listener::{Hearing, HearingWeights};
pub use stats::SoundStats;

#[cfg(test)]
mod tests;
