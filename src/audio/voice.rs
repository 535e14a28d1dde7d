//! One voice of the conversation: pushed in pieces of any size and rate, taken block by block at 24 kHz.

use super::resample::{Resampler, check_rate};
use super::ring::Ring;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_SAMPLES, SAMPLE_RATE};

/// Seconds of sound that a [`Voice::new`] holds ahead of the block that was taken last (5.8 MB).
pub const VOICE_SECONDS: u32 = 60;

/// Samples beyond this are clipped: 18 dB over full scale, far from any voice and far from overflow.
const CLIP: f32 = 8.0;

/// What was counted since the voice was made or reset; 24 kHz samples unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VoiceStats {
    /// Silence handed out in place of sound that had not come, while the voice was present.
    pub underrun_samples: u64,
    /// Dropped because the buffer was full.
    pub overflow_samples: u64,
    /// Clipped to 8 times full scale, input samples: a sign of integers pushed as floats.
    pub clipped_samples: u64,
}

/// A voice on the session's time line: sample `n` is heard `n / 24000` s after the session's start.
///
/// Sound goes to the end of what is there. A block that is taken before all of its sound has come is filled up with
/// silence, and what comes later follows after that silence: nothing that was pushed is lost, it is heard later.
/// Sound of another rate than 24 kHz is heard [`Voice::lag_samples`] later, which covers the resampler's look-ahead: sound
/// pushed up to a moment fills the line up to that moment, so neither the size of pushes nor how far ahead
/// they come changes what is heard.
///
/// Allocates when made and, off 24 kHz, on the first push and when the rate changes; not otherwise.
pub struct Voice {
    ring: Ring,
    resampler: Option<Resampler>,
    lag: usize,
    present: bool,
    stats: VoiceStats,
}

impl Voice {
    /// A voice that holds a minute of sound; absent until the first push.
    pub fn new() -> Self {
        Self::with_capacity(VOICE_SECONDS)
    }

    /// A voice that holds `seconds` (1 to 3600, else clamped) beyond the block that was taken last.
    pub fn with_capacity(seconds: u32) -> Self {
        let samples = seconds.clamp(1, 3600) as usize * SAMPLE_RATE as usize;
        Self { ring: Ring::new(samples), resampler: None, lag: 0, present: false, stats: VoiceStats::default() }
    }

    /// Appends mono `samples` (full scale 1.0) of `rate` Hz (8000 to 192000) and makes the voice present. An empty push
    /// changes nothing.
    ///
    /// On a change of rate the old resampler's last samples come first, as if silence followed, then the new stream
    /// starts as if silence preceded it: a fade within 1.4 ms of the seam (4 ms at 8 kHz). Where [`Voice::lag_samples`]
    /// grows, its growth is silence at the seam.
    ///
    /// # Errors
    /// [`ErrorKind::Audio`] for a rate out of range, or NaN or infinity among the samples; nothing of the push is taken.
    pub fn push(&mut self, samples: &[f32], rate: u32) -> Result<()> {
        check_rate(rate)?;
        if let Some(i) = samples.iter().position(|s| !s.is_finite()) {
            let message =
                format!("pushed sample {i} of {} is not a finite number; the push was ignored", samples.len());
            return Err(Error::new(ErrorKind::Audio, message));
        }
        if samples.is_empty() {
            return Ok(());
        }
        if self.resampler.as_ref().is_none_or(|r| r.rate() != rate) {
            let next = Resampler::new(rate)?;
            self.finish();
            let more = next.latency_samples().saturating_sub(self.lag);
            self.lag += more;
            self.stats.overflow_samples += self.ring.push_silence(more) as u64;
            self.resampler = Some(next);
        }
        self.present = true;
        let Self { ring, resampler: Some(resampler), stats, .. } = self else { return Ok(()) };
        let mut clipped = [0.0; 256];
        for piece in samples.chunks(clipped.len()) {
            let piece = if piece.iter().all(|s| s.abs() <= CLIP) {
                piece
            } else {
                for (to, s) in clipped.iter_mut().zip(piece) {
                    stats.clipped_samples += u64::from(s.abs() > CLIP);
                    *to = s.clamp(-CLIP, CLIP);
                }
                &clipped[..piece.len()]
            };
            resampler.push(piece, |s| stats.overflow_samples += ring.push(s) as u64);
        }
        Ok(())
    }

    /// Ends an utterance: the last samples, which wait in the resampler for what follows, come out. Optional: they
    /// come out with the next push otherwise.
    pub fn finish(&mut self) {
        let Self { ring, resampler: Some(resampler), stats, .. } = self else { return };
        resampler.finish(|s| stats.overflow_samples += ring.push(s) as u64);
    }

    /// Drops all sound that has not been taken, as when an utterance is broken off. The voice stays present.
    pub fn clear(&mut self) {
        self.ring.clear();
        if let Some(resampler) = &mut self.resampler {
            resampler.reset();
        }
    }

    /// Takes the sound of block `block` (samples `3200 block` up to `3200 (block + 1)`); returns whether the voice is
    /// present. The samples of an absent voice are zero and not counted. Sound of blocks that were passed over is dropped.
    ///
    /// # Errors
    /// [`ErrorKind::State`] when that block, or a later one, was taken before.
    pub fn take_block(&mut self, block: u64, out: &mut [f32; BLOCK_SAMPLES]) -> Result<bool> {
        let from = block.checked_mul(BLOCK_SAMPLES as u64).filter(|&from| from >= self.ring.start());
        let Some(from) = from else {
            let message = format!("sound of block {block} was taken before; take blocks in ascending order");
            return Err(Error::new(ErrorKind::State, message));
        };
        let missing = self.ring.take(from, out);
        if self.present {
            self.stats.underrun_samples += missing as u64;
        }
        Ok(self.present)
    }

    /// Whether there is a voice at all. An absent voice is not a silent one: the model was trained with both.
    pub fn is_present(&self) -> bool {
        self.present
    }

    /// Makes the voice present (silent until something is pushed), or absent until the next push, dropping its sound.
    pub fn set_present(&mut self, present: bool) {
        self.present = present;
        if !present {
            self.clear();
        }
    }

    /// Index of the sample that the next pushed sound becomes, 24 kHz since the session's start (sound inside the
    /// resampler not counted).
    pub fn end(&self) -> u64 {
        self.ring.end()
    }

    /// Samples (24 kHz) by which sound is heard later because it was resampled: 0 at 24 kHz, else the longest look-ahead
    /// of the rates that were pushed.
    pub fn lag_samples(&self) -> usize {
        self.lag
    }

    /// Counters since the start.
    pub fn stats(&self) -> VoiceStats {
        self.stats
    }

    /// Absent, empty and at time 0, as when new.
    pub fn reset(&mut self) {
        self.reset_at(0);
    }

    /// Absent and empty; the next sound that is pushed belongs to block `block` and those after it.
    pub fn reset_at(&mut self, block: u64) {
        self.ring.reset(block * BLOCK_SAMPLES as u64);
        (self.resampler, self.lag, self.present, self.stats) = (None, 0, false, VoiceStats::default());
    }
}

impl Default for Voice {
    fn default() -> Self {
        Self::new()
    }
}
