//! The end of pushed sound that is heard: one stream, read in order by one thread.

use super::input::VoiceInput;
use super::line::{Glimpse, Input, VoiceStats};
use super::pair::PairInput;

/// A bounded stream of 24 kHz samples that any thread pushes into ([`Stream::input`]) and one
/// reads. One of a [`PairInput`] has two samples, left and right, where it says one.
pub struct Stream<I = VoiceInput> {
    input: I,
    /// What [`Stream::look`] found.
    seen: Glimpse,
    /// Number of the next sample.
    at: u64,
}

impl Stream<VoiceInput> {
    /// A stream that holds `samples` of 24 kHz; what is louder than `clip` is clipped. `inbox` is
    /// how many records wait while another thread is inside.
    pub(crate) fn new(samples: usize, clip: f32, inbox: usize) -> Self {
        Self { input: VoiceInput::new(samples, clip, inbox), seen: Glimpse::default(), at: 0 }
    }
}

impl Stream<PairInput> {
    /// A stream of pairs, left and right in turn, that holds `pairs` of 24 kHz; what is louder than
    /// `clip` is clipped.
    pub(crate) fn pairs(pairs: usize, clip: f32) -> Self {
        Self { input: PairInput::new(pairs, clip), seen: Glimpse::default(), at: 0 }
    }
}

impl<I: Input> Stream<I> {
    /// The end that is pushed into.
    pub fn input(&self) -> &I {
        &self.input
    }

    /// Takes notice of what was pushed: that, and no more, is heard until the next look. Whether
    /// sound that had been noticed was cleared.
    pub fn look(&mut self) -> bool {
        self.seen = self.input.line().glimpse();
        let cut = self.seen.cleared > self.at;
        self.at = self.at.max(self.seen.cleared);
        cut
    }

    /// Whether anything has been pushed since it was made or reset, or it was made present.
    pub fn is_present(&self) -> bool {
        self.seen.present
    }

    /// Samples that were noticed and not taken.
    pub fn ahead(&self) -> u64 {
        self.seen.written - self.at
    }

    /// Copies the next samples without taking them; returns how many there were, zeros stand for
    /// the others.
    pub fn peek(&self, out: &mut [f32]) -> usize {
        let mut have = self.ahead().min(out.len() as u64) as usize;
        let line = self.input.line();
        line.read(self.at, &mut out[..have]);
        if line.is_cut(self.at) {
            have = 0;
        }
        out[have..].fill(0.0);
        have
    }

    /// Takes the next samples, as [`Stream::peek`].
    pub fn take(&mut self, out: &mut [f32]) -> usize {
        let have = self.peek(out);
        self.pass(have as u64);
        have
    }

    /// Drops the next `samples`, as far as they are there.
    pub fn pass(&mut self, samples: u64) {
        self.at += samples.min(self.ahead());
        self.input.line().take(self.at);
    }

    /// Samples by which sound is heard later because it was resampled.
    pub fn lag(&self) -> usize {
        self.input.line().lag()
    }

    /// What was counted; underruns are the reader's to count.
    pub fn stats(&self) -> VoiceStats {
        self.input.line().stats()
    }

    /// Absent and empty. Waits for a push that is under way.
    pub fn reset(&mut self) {
        self.input.reset();
        self.look();
    }
}
