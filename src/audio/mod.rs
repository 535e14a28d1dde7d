//! Voices: from sound files and pushed samples to one feature vector a frame.
//!
//! ```text
//! file: Wav ──┐
//!             ├─> Voice (Resampler, ring on the session's time line) ──> AudioEncoder ──> D_a features a frame
//! push: f32 ──┘   any rate and size in, 3200 samples a block out         on our kernels, or TractEncoder
//!    VoiceInput, from any thread
//! ```

mod encoder;
mod input;
mod line;
mod resample;
#[cfg(feature = "tract")]
mod tract;
mod voice;
mod wav;
mod weights;

pub use encoder::AudioEncoder;
pub use input::{Speaker, VoiceInput};
pub use resample::{MAX_RATE, MIN_RATE, Resampler, resample_to_24k};
#[cfg(feature = "tract")]
pub use tract::TractEncoder;
pub use voice::{VOICE_SECONDS, Voice, VoiceStats};
pub use wav::Wav;
pub use weights::{AudioWeights, LayerWeights, check_audio_config};

/// What computes the audio encoder.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum AudioBackend {
    /// Our kernels, [`AudioEncoder`]: no allocation in a block, the same bits on every CPU.
    #[default]
    Kernels,
    /// tract-core, [`TractEncoder`]: allocates in every block; equals the kernels within 1e-5 for float weights.
    #[cfg(feature = "tract")]
    Tract,
}

#[cfg(test)]
mod encoder_tests;
#[cfg(test)]
mod tests;
