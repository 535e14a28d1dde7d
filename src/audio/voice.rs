//! One voice of the conversation: pushed in pieces of any size and rate, taken block by block at 24
//! kHz.

use super::input::VoiceInput;
use super::line::VoiceStats;
use super::stream::Stream;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_SAMPLES, SAMPLE_RATE};

/// Seconds of sound that a [`Voice::new`] holds ahead of the block that was taken last (5.8 MB).
pub const VOICE_SECONDS: f64 = 60.0;
/// Samples beyond this are clipped: 18 dB over full scale, far from any voice and far from
/// overflow.
const CLIP: f32 = 8.0;
/// Records that the inbox holds. A push takes one for each 256 samples that it begins, so these
/// are 0.6 s of 48 kHz that comes 64 samples at a time, and 2.4 s of 10 ms at a time.
pub(super) const INBOX: usize = 512;

/// A voice on the session's time line: sample `n` is heard `n / 24000` s after the session's start.
///
/// Sound goes to the end of what is there. A block that is taken before all of its sound has come
/// is filled up with silence, and what comes later follows after that silence: nothing that was
/// pushed is lost, it is heard later. Sound of another rate than 24 kHz is heard
/// [`Voice::lag_samples`] later, which covers the resampler's look-ahead: sound pushed up to a
/// moment fills the line up to that moment, so neither the size of pushes nor how far ahead they
/// come changes what is heard.
///
/// This is the end that is heard, and one thread's; [`Voice::input`] is the end that is pushed
/// into, any thread's.
pub struct Voice {
    stream: Stream,
    /// Sample of the session's time line that the next one of the stream becomes.
    start: u64,
    underrun: u64,
}

impl Voice {
    /// A voice that holds a minute of sound; absent until the first push.
    pub fn new() -> Self {
        Self::with_capacity(VOICE_SECONDS)
    }

    /// A voice that holds `seconds` (0.5 to 3600, else clamped) beyond the block that was taken
    /// last.
    pub fn with_capacity(seconds: f64) -> Self {
        let samples = (seconds.clamp(0.5, 3600.0) * f64::from(SAMPLE_RATE)) as usize;
        Self { stream: Stream::new(samples, CLIP, INBOX), start: 0, underrun: 0 }
    }

    /// The end that is pushed into.
    pub fn input(&self) -> &VoiceInput {
        self.stream.input()
    }

    /// Takes notice of what was pushed: blocks that are taken from now on, until the next look,
    /// hear that and no more.
    pub fn look(&mut self) {
        self.stream.look();
    }

    /// Takes the sound of block `block` (samples `3200 block` up to `3200 (block + 1)`); returns
    /// whether the voice is present. The samples of an absent voice are zero and not counted. Sound
    /// of blocks that were passed over is dropped.
    ///
    /// # Errors
    /// [`ErrorKind::State`] when that block, or a later one, was taken before.
    pub fn take_block(&mut self, block: u64, out: &mut [f32; BLOCK_SAMPLES]) -> Result<bool> {
        let from = block.checked_mul(BLOCK_SAMPLES as u64).filter(|&from| from >= self.start);
        let Some(from) = from else {
            let message = format!("sound of block {block} was taken before; take blocks in ascending order");
            return Err(Error::new(ErrorKind::State, message));
        };
        let passed = from - self.start;
        self.start = from + BLOCK_SAMPLES as u64;
        if !self.is_present() {
            out.fill(0.0);
            return Ok(false);
        }
        self.stream.pass(passed);
        let have = self.stream.take(out);
        self.underrun += (BLOCK_SAMPLES - have) as u64;
        Ok(true)
    }

    /// Whether there is a voice at all. An absent voice is not a silent one: the model was trained
    /// with both.
    pub fn is_present(&self) -> bool {
        self.stream.is_present()
    }

    /// Samples (24 kHz) by which sound is heard later because it was resampled: 0 at 24 kHz, else
    /// the longest look-ahead of the rates that were pushed.
    pub fn lag_samples(&self) -> usize {
        self.stream.lag()
    }

    /// Counters since the start.
    pub fn stats(&self) -> VoiceStats {
        VoiceStats { underrun_samples: self.underrun, ..self.stream.stats() }
    }

    /// Absent and empty; the next sound that is pushed belongs to block `block` and those after it.
    pub fn reset_at(&mut self, block: u64) {
        self.stream.reset();
        (self.start, self.underrun) = (block * BLOCK_SAMPLES as u64, 0);
    }
}

impl Default for Voice {
    fn default() -> Self {
        Self::new()
    }
}
