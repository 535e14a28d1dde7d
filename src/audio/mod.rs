//! Voices: from sound files and pushed samples to one feature vector a frame.
//!
//! ```text
//! file ─ Wav ─┐                                     ┌─ AudioEncoder (our kernels, no allocation in a block)
//!             ├─ Voice: Resampler, ring on a time line ─┤
//! push(rate) ─┘        24 kHz mono, blocks of 3200  └─ TractEncoder (feature `tract`, the second opinion)
//! ```

mod resample;
mod ring;
mod voice;
mod wav;

pub use resample::{MAX_RATE, MIN_RATE, Resampler, resample_to_24k};
pub use voice::{VOICE_SECONDS, Voice, VoiceStats};
pub use wav::Wav;

#[cfg(test)]
mod tests;
