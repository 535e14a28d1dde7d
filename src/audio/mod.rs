//! Voices: from pushed samples to one feature vector per frame.
//!
//! ```text
//! push: f32 ──> VoiceInput ───────────> Voice ─────────────────> AudioEncoder ──> features
//! any size,     resampler; a ring of    3200 samples per block,  on our kernels,  D_a per
//! rate, thread  24 kHz                  on the session's time    or TractEncoder  frame
//! ```
//!
//! And, for whole clips at a desk (`internals` alone): what two ears hear of a sound somewhere
//! (`ears`), and `features` of what an ear hears.

#[cfg(feature = "internals")]
pub mod ears;
mod encoder;
#[cfg(feature = "internals")]
pub mod features;
mod feed;
pub mod fft;
pub mod head;
mod input;
mod line;
mod pair;
mod resample;
mod stream;
#[cfg(feature = "tract")]
mod tract;
mod voice;
mod weights;

pub use encoder::AudioEncoder;
pub use input::{Speaker, VoiceInput};
pub use line::VoiceStats;
pub use pair::PairInput;
#[cfg(feature = "internals")]
pub use resample::resample_to_24k;
pub use resample::{MAX_RATE, MIN_RATE, Resampler, check_rate};
pub use stream::Stream;
#[cfg(feature = "tract")]
pub use tract::TractEncoder;
pub use voice::{VOICE_SECONDS, Voice};
pub use weights::{AudioWeights, LayerWeights, check_audio_config};

/// What computes the audio encoder.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum AudioBackend {
    /// Our kernels, [`AudioEncoder`]: no allocation in a block, the same bits on every CPU.
    #[default]
    Kernels,
    /// tract-core, [`TractEncoder`]: allocates in every block; equals the kernels within 1e-5 for
    /// float weights.
    #[cfg(feature = "tract")]
    Tract,
}

#[cfg(test)]
mod encoder_tests;
#[cfg(test)]
mod tests;
