//! A finished piece of motion with what was heard and seen: what exporters, the viewer and metrics
//! read.

use glam::Vec3;
use visavis::{Frame, Rig};

/// A recorded conversation.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The skeleton.
    pub rig: Rig,
    /// Frames at 30 fps, consecutive.
    pub frames: Vec<Frame>,
    /// World position of the user's head at each frame, metres; `None` where unknown. As long as
    /// `frames`.
    pub user: Vec<Option<Vec3>>,
    /// The agent's voice, 24 kHz mono, -1 to 1, starting with frame 0.
    pub agent_voice: Option<Vec<f32>>,
    /// The user's voice, likewise.
    pub user_voice: Option<Vec<f32>>,
    /// The gaze target that was asked for, 0 to 1, or `None` for free gaze.
    pub gaze_target: Option<f32>,
    /// Sounds in the room, where there are any.
    pub sounds: Option<Sounds>,
}

/// Sounds in the room.
#[derive(Debug, Clone, PartialEq)]
pub struct Sounds {
    /// Where each comes from, and when.
    pub sources: Vec<Source>,
    /// What the agent hears of all of them, the mean of its ears: 24 kHz, -1 to 1, starting with
    /// frame 0.
    pub heard: Vec<f32>,
}

/// A source of sound.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// What it is called, plain text.
    pub name: String,
    /// Where it is in the world, metres.
    pub position: Vec3,
    /// When it begins and ends, seconds.
    pub seconds: [f64; 2],
}
