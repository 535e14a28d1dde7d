//! Procedural motion for tests, as a recording.

use crate::recording::Recording;
use visavis::internals::frame::FRAME_SAMPLES;
use visavis::internals::pose::synthetic;

/// [`synthetic::walk`] with two tones for voices and a gaze target.
pub(crate) fn walk(frames: usize) -> Recording {
    let synthetic::Walk { rig, frames, user } = synthetic::walk(frames);
    let voice = |hz: f32| Some((0..frames.len() * FRAME_SAMPLES).map(|i| 0.3 * (i as f32 * hz).sin()).collect());
    let (agent_voice, user_voice) = (voice(0.05), voice(0.08));
    Recording { rig, frames, user, agent_voice, user_voice, gaze_target: Some(0.8), sounds: None }
}
