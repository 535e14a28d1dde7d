//! Voices: from pushed samples to one feature vector per frame.
//!
//! ```text
//! push: f32 ──> Voice (Resampler, ring on the session's time line) ──> AudioEncoder ──> D_a features per frame
//!               any rate and size in, 3200 samples per block out       on our kernels, or TractEncoder
//! ```

mod encoder;
mod resample;
mod ring;
#[cfg(feature = "tract")]
mod tract;
mod voice;
mod weights;

pub use encoder::AudioEncoder;
pub use resample::{MAX_RATE, MIN_RATE, Resampler, check_rate, resample_to_24k};
#[cfg(feature = "tract")]
pub use tract::TractEncoder;
pub use voice::{VOICE_SECONDS, Voice, VoiceStats};
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
