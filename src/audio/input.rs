//! The end of a voice that is pushed into, from any thread.
//!
//! ```text
//! push ──> feed (resampler) ──> line of 24 kHz samples ──> Voice, in the session's block
//!    └──> inbox ─┘  while another thread has the feed
//! ```
//!
//! The feed is one thread's at a time, by `try_lock`. A thread that does not get it leaves what it
//! has in the inbox, and the thread that has the feed looks there before it starts and after it has
//! let go: nobody waits, and what one thread pushes stays in order.

use super::feed::{Command, Feed};
use super::line::{Input, Line};
use super::resample::{Resampler, check_rate};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::SAMPLE_RATE;
use crate::queue::Queue;
use std::sync::atomic::Ordering::{Relaxed, SeqCst};
use std::sync::atomic::fence;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

/// Samples that are handled at once.
pub(super) const PIECE: usize = 256;
/// Words of a record of the inbox: what it is, and two samples a word.
const WORDS: usize = 1 + PIECE / 2;
/// Records of the inbox that are kept for commands: sound that is too much is dropped before any
/// command is.
const COMMANDS: usize = 32;

/// Tells of samples that were not finite.
pub(super) fn check_finite(bad: usize, samples: usize) -> Result<()> {
    if bad == 0 {
        return Ok(());
    }
    let message = format!("{bad} of {samples} pushed samples are not finite numbers; silence is in their place");
    Err(Error::new(ErrorKind::Audio, message))
}

/// One of the two who talk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Speaker {
    /// The agent itself, usually known ahead (text-to-speech). Number 0.
    Agent,
    /// The user, as the microphone hears it. Number 1.
    User,
}

impl TryFrom<i32> for Speaker {
    type Error = Error;

    /// The speaker of a number, as languages without this type have it.
    fn try_from(number: i32) -> Result<Self> {
        match number {
            0 => Ok(Self::Agent),
            1 => Ok(Self::User),
            _ => Err(Error::new(ErrorKind::Argument, format!("voice {number}: 0 is the agent, 1 the user"))),
        }
    }
}

/// A voice's input: pushes sound into a session from any thread.
///
/// Also while that session computes a block: nothing here waits for a block or for another thread,
/// and nothing but the first push of a voice, or of another rate, allocates
/// ([`VoiceInput::prepare`] does so ahead). A block hears what was pushed before its poll began.
///
/// A voice is one stream: sound stands in the order in which it was pushed, and how it was cut does
/// not matter. So one thread pushes a voice's sound; commands may come from others. Should two
/// threads push sound at the same moment, both are heard, one after the other, in pieces. While one
/// thread is inside and has lost its core, what others push is kept, 480 pushes of up to 256
/// samples; what is more is dropped and counted
/// ([`VoiceStats::contended_samples`](super::VoiceStats::contended_samples)).
#[derive(Clone)]
pub struct VoiceInput {
    shared: Arc<Shared>,
}

struct Shared {
    line: Line,
    inbox: Queue<WORDS>,
    feed: Mutex<Feed>,
    /// Samples beyond this are clipped.
    clip: f32,
}

impl VoiceInput {
    /// A voice that holds `samples` of 24 kHz of up to `clip`, and `inbox` records while another
    /// thread is inside; absent.
    pub(super) fn new(samples: usize, clip: f32, inbox: usize) -> Self {
        let (line, inbox) = (Line::new(samples), Queue::new(inbox));
        Self { shared: Arc::new(Shared { line, inbox, feed: Mutex::default(), clip }) }
    }

    /// Appends mono `samples` (full scale 1.0) of `rate` Hz (8000 to 192000) and makes the voice
    /// present. An empty push changes nothing.
    ///
    /// Up to a minute is kept ahead of the block that was computed last, or what the session's
    /// options say; what is more is dropped and counted. Samples that are not finite are silence,
    /// those beyond 8 times full scale are clipped; both are counted.
    ///
    /// On a change of rate the old resampler's last samples come first, as if silence followed,
    /// then the new stream starts as if silence preceded it: a fade within 1.4 ms of the seam (4 ms
    /// at 8 kHz). Where the lag of resampling grows, its growth is silence at the seam.
    ///
    /// # Errors
    /// [`ErrorKind::Audio`] for a rate out of range, of which nothing is taken, and for NaN or
    /// infinity among the samples, in whose place there is silence: the rest of the push is taken.
    /// Both are counted.
    pub fn push(&self, samples: &[f32], rate: u32) -> Result<()> {
        let Shared { line, inbox, clip, .. } = &*self.shared;
        if let Err(e) = check_rate(rate) {
            line.counts.bad_rate.fetch_add(samples.len() as u64, Relaxed);
            return Err(e);
        }
        let mut bad = 0;
        let mut clean = [0.0; PIECE];
        let mut pieces = samples.chunks(PIECE).map(|piece| {
            bad += line.clean(piece, *clip, &mut clean);
            (clean, piece.len())
        });
        let mut done = Ok(());
        if let Some(mut feed) = self.feed() {
            done = pieces.try_for_each(|(piece, len)| feed.push(line, &piece[..len], rate));
        } else {
            let mut record = [0; WORDS];
            for (piece, len) in &mut pieces {
                record[0] = u64::from(rate) | (len as u64) << 18;
                let pairs =
                    piece.chunks_exact(2).map(|two| u64::from(two[0].to_bits()) | u64::from(two[1].to_bits()) << 32);
                record[1..].iter_mut().zip(pairs).for_each(|(to, word)| *to = word);
                if inbox.room() <= COMMANDS || !inbox.push(&record[..1 + len.div_ceil(2)]) {
                    line.counts.contended.fetch_add(len as u64, Relaxed);
                }
            }
        }
        self.sweep();
        check_finite(bad, samples.len()).and(done)
    }

    /// Makes what converts sound of `rate` Hz, so that the first push of that rate does not
    /// allocate either: for callbacks of audio devices, ahead of time. Without effect while another
    /// thread pushes into this voice.
    ///
    /// # Errors
    /// [`ErrorKind::Audio`] for a rate outside 8 to 192 kHz.
    pub fn prepare(&self, rate: u32) -> Result<()> {
        check_rate(rate)?;
        if let Some(mut feed) = self.feed() {
            feed.spare = Some(Resampler::new(rate)?);
        }
        self.sweep();
        Ok(())
    }

    /// Ends an utterance: the last samples, which wait in the resampler for what follows, come out.
    /// Optional: they come out with the next push otherwise.
    pub fn finish(&self) {
        self.command(Command::Finish);
    }

    /// Drops all sound that no block has used, as when an utterance is broken off; a block that is
    /// being computed may hear silence already. The voice stays present.
    pub fn clear(&self) {
        self.command(Command::Clear);
    }

    /// What is pushed from here on is another sound: what the resampler still holds is forgotten,
    /// and the lag of resampling comes first again, so that a stream that is pushed as it is heard
    /// is never short.
    pub(crate) fn begin(&self) {
        self.command(Command::Begin);
    }

    /// Whether all that was pushed has been taken or cleared.
    pub(crate) fn is_drained(&self) -> bool {
        self.shared.line.is_drained()
    }

    /// Makes the voice present (silent until something is pushed), or absent until the next push,
    /// dropping its sound. An absent voice is not a silent one: the model was trained with both.
    pub fn set_present(&self, present: bool) {
        self.command(Command::Present(present));
    }

    fn command(&self, command: Command) {
        if let Some(mut feed) = self.feed() {
            feed.obey(&self.shared.line, command);
        } else if !self.shared.inbox.push(&[command.word()]) {
            // Dozens of commands, or hundreds, since the thread that has the feed lost its core.
            self.shared.line.counts.contended.fetch_add(1, Relaxed);
        }
        self.sweep();
    }

    /// The feed, with the inbox empty, unless another thread has it.
    fn feed(&self) -> Option<MutexGuard<'_, Feed>> {
        let mut feed = match self.shared.feed.try_lock() {
            Ok(feed) => feed,
            Err(TryLockError::Poisoned(feed)) => feed.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        self.shared.collect(&mut feed);
        Some(feed)
    }

    /// Looks into the inbox when the feed has been let go, or was another thread's.
    fn sweep(&self) {
        loop {
            // One of two threads sees the other: the one that left a record sees that the feed is
            // free, or the one that let the feed go sees the record.
            fence(SeqCst);
            if !self.shared.inbox.is_ready() || self.feed().is_none() {
                return;
            }
        }
    }
}

impl Input for VoiceInput {
    fn line(&self) -> &Line {
        &self.shared.line
    }

    fn reset(&self) {
        let mut feed = self.shared.feed.lock().unwrap_or_else(PoisonError::into_inner);
        while self.shared.inbox.pop(&mut [0; WORDS]) {}
        *feed = Feed::default();
        let line = &self.shared.line;
        line.clear();
        line.set_present(false);
        line.set_lag(0);
        line.forget_counts();
        drop(feed);
        self.sweep();
    }
}

impl Shared {
    /// Takes what is in the inbox.
    fn collect(&self, feed: &mut Feed) {
        let mut record = [0; WORDS];
        while self.inbox.pop(&mut record) {
            if record[0] >= Command::FIRST {
                feed.obey(&self.line, Command::of(record[0]));
                continue;
            }
            let (rate, len) = (record[0] as u32 & 0x3_ffff, (record[0] >> 18) as usize);
            let mut piece = [0.0; PIECE];
            for (two, word) in piece.chunks_exact_mut(2).zip(&record[1..]) {
                two.copy_from_slice(&[f32::from_bits(*word as u32), f32::from_bits((word >> 32) as u32)]);
            }
            if feed.push(&self.line, &piece[..len], rate).is_err() {
                self.line.counts.bad_rate.fetch_add(len as u64, Relaxed);
            }
        }
    }
}

impl std::fmt::Debug for VoiceInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let seconds = self.shared.line.glimpse().written as f64 / f64::from(SAMPLE_RATE);
        f.debug_struct("VoiceInput").field("seconds", &seconds).finish_non_exhaustive()
    }
}

#[cfg(test)]
#[path = "input_tests.rs"]
mod tests;
