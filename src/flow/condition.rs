//! What a token is told.

use crate::config::{ACTIVITY, Config, HearingConfig};

/// Where each modality lies in a [`Condition`]'s values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConditionLayout {
    /// Width of the audio features of one frame.
    pub audio_features: usize,
    /// Length of the sound vector; 0 of a bundle without hearing.
    pub sound: usize,
    /// Values of the activity at rest; 0 of a bundle that is told of none.
    pub activity: usize,
}

impl ConditionLayout {
    const USER: usize = 8;
    const GAZE: usize = 4;

    /// That of a bundle.
    pub fn of(config: &Config) -> Self {
        let sound = config.hearing.as_ref().map_or(0, HearingConfig::width);
        let activity = config.rest.as_ref().map_or(0, |_| ACTIVITY);
        Self { audio_features: config.audio.features, sound, activity }
    }

    /// Number of values: 4 x 2 user positions, 4 frames of features of each voice, 4 gaze scores,
    /// the sound vector, the activity at rest.
    pub fn width(&self) -> usize {
        self.activity().end
    }

    pub(super) fn user(&self) -> std::ops::Range<usize> {
        0..Self::USER
    }

    pub(super) fn agent_voice(&self) -> std::ops::Range<usize> {
        Self::USER..Self::USER + 4 * self.audio_features
    }

    pub(super) fn user_voice(&self) -> std::ops::Range<usize> {
        let start = Self::USER + 4 * self.audio_features;
        start..start + 4 * self.audio_features
    }

    pub(super) fn gaze(&self) -> std::ops::Range<usize> {
        let start = self.user_voice().end;
        start..start + Self::GAZE
    }

    pub(super) fn sound(&self) -> std::ops::Range<usize> {
        self.gaze().end..self.gaze().end + self.sound
    }

    pub(super) fn activity(&self) -> std::ops::Range<usize> {
        let start = self.sound().end;
        start..start + self.activity
    }
}

/// Conditioning of one token (one block). A modality that is absent has its flag off; its values
/// are not looked at.
///
/// This is the seam of the generator: whatever produces motion takes a `Condition` a block.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    layout: ConditionLayout,
    pub(super) values: Vec<f32>,
    /// Presence of the user's position, the agent's voice, the user's voice and the gaze target.
    pub(super) present: [bool; 4],
    /// Whether sounds in the room are listened to.
    pub(super) hears: bool,
    /// Whether the body is at rest and its activity is told.
    pub(super) rests: bool,
    /// Whether the gaze target is guided towards, by a branch of its own.
    pub(super) guided: bool,
}

impl Condition {
    /// Everything absent.
    pub fn absent(layout: ConditionLayout) -> Self {
        Self {
            layout,
            values: vec![0.0; layout.width()],
            present: [false; 4],
            hears: false,
            rests: false,
            guided: false,
        }
    }

    /// Makes everything absent again.
    pub fn clear(&mut self) {
        (self.present, self.hears, self.rests, self.guided) = ([false; 4], false, false, false);
    }

    /// The user's floor positions `(x, z)` over four frames in the agent's frame, metres.
    pub fn set_user(&mut self, positions: &[f32; 8]) {
        self.values[self.layout.user()].copy_from_slice(positions);
        self.present[0] = true;
    }

    /// Features of the agent's voice, `[4, audio_features]`.
    pub fn set_agent_voice(&mut self, features: &[f32]) {
        self.values[self.layout.agent_voice()].copy_from_slice(features);
        self.present[1] = true;
    }

    /// Features of the user's voice, `[4, audio_features]`.
    pub fn set_user_voice(&mut self, features: &[f32]) {
        self.values[self.layout.user_voice()].copy_from_slice(features);
        self.present[2] = true;
    }

    /// Gaze target, -1 to 1, the same for the four frames. `guided`: towards it, with a guidance
    /// weight of its own; else it is a condition among the others. The student, which has its
    /// guidance in its weights, makes no difference.
    pub fn set_gaze(&mut self, target: f32, guided: bool) {
        self.values[self.layout.gaze()].fill(target);
        (self.present[3], self.guided) = (true, guided);
    }

    /// The sound vector, `[S]`; of a bundle without hearing there is none.
    pub fn set_sound(&mut self, vector: &[f32]) {
        self.values[self.layout.sound()].copy_from_slice(vector);
        self.hears = true;
    }

    /// How active the body is, which is at rest; of a bundle that is told of it. Part of every
    /// guidance branch: guidance is towards what is heard and seen.
    pub fn set_activity(&mut self, level: &[f32; ACTIVITY]) {
        self.values[self.layout.activity()].copy_from_slice(level);
        self.rests = true;
    }

    /// Whether a gaze target is guided towards, so that the reference network has a third branch to
    /// run.
    pub fn guides_gaze(&self) -> bool {
        self.present[3] && self.guided
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        debug_assert_eq!(self.layout, other.layout);
        self.values.copy_from_slice(&other.values);
        (self.present, self.hears, self.rests, self.guided) = (other.present, other.hears, other.rests, other.guided);
    }

    pub(super) fn layout(&self) -> ConditionLayout {
        self.layout
    }
}
