//! The end of a pair of streams that is pushed into: what two microphones hear.
//!
//! Left and right are one line of pairs, so they cannot slip against each other, whatever is
//! dropped or broken off. Who pushes has both resamplers by `try_lock`; there is no inbox, because
//! two threads that push the same ears at once have no order between them.

use super::input::{PIECE, check_finite};
use super::line::{Input, Line};
use super::resample::{Resampler, check_rate};
use crate::error::{Error, ErrorKind, Result};
use std::sync::atomic::Ordering::{AcqRel, Relaxed, Release, SeqCst};
use std::sync::atomic::{AtomicBool, fence};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// The most pairs that a piece becomes, or a resampler's rest: three for one, and what one chunk
/// and the look-ahead hold.
const MOST: usize = 1024;

/// The input of a pair of streams, for any thread, one at a time.
#[derive(Clone)]
pub struct PairInput {
    shared: Arc<Shared>,
}

struct Shared {
    /// Left and right in turn.
    line: Line,
    feed: Mutex<Feed>,
    /// Whether somebody broke the sound off while another thread had the feed.
    clear: AtomicBool,
    /// Whether the reader ran dry: what is pushed next is a sound of its own.
    dry: AtomicBool,
    clip: f32,
}

/// What makes pairs of 24 kHz, for one thread at a time.
struct Feed {
    resamplers: Option<[Resampler; 2]>,
    /// One ear, and pairs.
    ear: [f32; MOST],
    pairs: [f32; 2 * MOST],
}

impl Default for Feed {
    fn default() -> Self {
        Self { resamplers: None, ear: [0.0; MOST], pairs: [0.0; 2 * MOST] }
    }
}

impl Feed {
    /// Appends the pairs that `make` of each resampler gives, as many of one ear as of the other.
    fn append(&mut self, line: &Line, mut make: impl FnMut(usize, &mut Resampler, &mut dyn FnMut(&[f32]))) {
        let Self { resamplers: Some(resamplers), ear, pairs, .. } = self else { return };
        let mut made = 0;
        for (side, resampler) in resamplers.iter_mut().enumerate() {
            made = 0;
            make(side, resampler, &mut |samples| {
                ear[made..made + samples.len()].copy_from_slice(samples);
                made += samples.len();
            });
            pairs[side..].iter_mut().step_by(2).zip(&ear[..made]).for_each(|(to, s)| *to = *s);
        }
        line.push(&pairs[..2 * made]);
    }

    fn finish(&mut self, line: &Line) {
        self.append(line, |_, resampler, out| resampler.finish(out));
    }

    /// What is pushed from here on is another sound.
    fn begin(&mut self, line: &Line) {
        line.set_lag(0);
        self.resamplers.iter_mut().flatten().for_each(Resampler::reset);
    }

    fn push(&mut self, line: &Line, ears: [&[f32]; 2], rate: u32) -> Result<()> {
        if self.resamplers.as_ref().is_none_or(|[left, _]| left.rate() != rate) {
            let next = [Resampler::new(rate)?, Resampler::new(rate)?];
            self.finish(line);
            self.resamplers = Some(next);
        }
        let latency = self.resamplers.as_ref().map_or(0, |[left, _]| left.latency_samples());
        let more = latency.saturating_sub(line.lag());
        line.set_lag(line.lag() + more);
        line.push_silence(2 * more);
        self.append(line, |side, resampler, out| resampler.push(ears[side], out));
        line.set_present(true);
        Ok(())
    }
}

impl PairInput {
    pub(super) fn new(pairs: usize, clip: f32) -> Self {
        let (line, feed) = (Line::new(2 * pairs), Mutex::default());
        let (clear, dry) = (AtomicBool::new(false), AtomicBool::new(true));
        Self { shared: Arc::new(Shared { line, feed, clear, dry, clip }) }
    }

    /// Appends `left` and `right`, samples of `rate` Hz. Sound that comes while another thread
    /// pushes is dropped and counted.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where they are not of one length, [`ErrorKind::Audio`] for a rate
    /// out of range: of both nothing is taken. [`ErrorKind::Audio`] for samples that are not
    /// finite, in whose place there is silence.
    pub(crate) fn push(&self, left: &[f32], right: &[f32], rate: u32) -> Result<()> {
        let Shared { line, clip, .. } = &*self.shared;
        if left.len() != right.len() {
            let message = format!(
                "{} samples of the left ear and {} of the right one; push as many of both",
                left.len(),
                right.len()
            );
            return Err(Error::new(ErrorKind::Argument, message));
        }
        if let Err(e) = check_rate(rate) {
            line.counts.bad_rate.fetch_add(2 * left.len() as u64, Relaxed);
            return Err(e);
        }
        if left.is_empty() {
            return Ok(());
        }
        let (mut bad, mut done) = (0, Ok(()));
        if let Some(mut feed) = self.feed() {
            if self.shared.dry.swap(false, AcqRel) {
                feed.begin(line);
            }
            let mut clean = [[0.0; PIECE]; 2];
            for pieces in left.chunks(PIECE).zip(right.chunks(PIECE)) {
                let count = pieces.0.len();
                for (piece, clean) in [pieces.0, pieces.1].into_iter().zip(&mut clean) {
                    bad += line.clean(piece, *clip, clean);
                }
                let ears = [&clean[0][..count], &clean[1][..count]];
                done = done.and_then(|()| feed.push(line, ears, rate));
            }
        } else {
            line.counts.contended.fetch_add(2 * left.len() as u64, Relaxed);
        }
        self.sweep();
        check_finite(bad, 2 * left.len()).and(done)
    }

    /// Drops all that no block has heard; what is pushed next is a sound of its own.
    pub(crate) fn clear(&self) {
        self.shared.clear.store(true, SeqCst);
        self.sweep();
    }

    /// The reader ran dry: what the resamplers still hold is forgotten with the next push.
    pub(crate) fn run_dry(&self) {
        self.shared.dry.store(true, Release);
    }

    /// Lets out what the resamplers hold, unless a push is under way: then there is more to come.
    pub(crate) fn finish(&self) {
        if let Some(mut feed) = self.feed() {
            feed.finish(&self.shared.line);
        }
    }

    /// The feed, unless another thread has it.
    fn feed(&self) -> Option<MutexGuard<'_, Feed>> {
        let feed = match self.shared.feed.try_lock() {
            Ok(feed) => feed,
            Err(TryLockError::Poisoned(feed)) => feed.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        if self.shared.clear.swap(false, SeqCst) {
            self.shared.line.clear();
            self.run_dry();
        }
        Some(feed)
    }

    /// Does what was asked for while the feed was another thread's.
    fn sweep(&self) {
        loop {
            // Who asked sees that the feed is free, or who let it go sees what was asked.
            fence(SeqCst);
            if !self.shared.clear.load(SeqCst) || self.feed().is_none() {
                return;
            }
        }
    }
}

impl Input for PairInput {
    fn line(&self) -> &Line {
        &self.shared.line
    }

    fn reset(&self) {
        let Shared { line, feed, clear, dry, .. } = &*self.shared;
        let mut feed = feed.lock().unwrap_or_else(PoisonError::into_inner);
        clear.store(false, SeqCst);
        dry.store(true, Release);
        *feed = Feed::default();
        line.clear();
        line.set_present(false);
        line.set_lag(0);
        line.forget_counts();
    }
}
