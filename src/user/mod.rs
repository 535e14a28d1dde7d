//! The person in front of the agent: a head position at any rate, asked for at frame times.

mod input;
mod track;

pub use input::HeadInput;
pub use track::{HeadTrack, Presence, TrackStats, UserSample};

/// A position is held for this long after the last one that came; then the user is absent. Seconds.
pub const HOLD_SECONDS: f64 = 0.5;
/// Positions further than this from the session's origin are not believed, metres.
pub const MAX_DISTANCE: f32 = 1_000.0;
/// A head that moves faster than this between two samples was put there (a tracker that lost it, a
/// teleport), m/s.
pub const TELEPORT_SPEED: f32 = 12.0;
