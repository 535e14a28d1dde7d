//! Sound on its way from whoever pushes a voice to the block that hears it: a bounded line of 24
//! kHz samples with one writer and one reader at a time, neither of which waits for the other.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, fence};

/// What was counted since the voice was made or reset; 24 kHz samples unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VoiceStats {
    /// Silence handed out in place of sound that had not come, while the voice was present.
    pub underrun_samples: u64,
    /// Dropped because the buffer was full.
    pub overflow_samples: u64,
    /// Clipped to 8 times full scale, input samples: a sign of integers pushed as floats.
    pub clipped_samples: u64,
    /// NaN or infinity, which silence replaced, input samples.
    pub non_finite_samples: u64,
    /// Pushed at a rate out of range and not taken, input samples.
    pub bad_rate_samples: u64,
    /// Dropped because another thread was inside this voice's input and lost its core there for
    /// long, input samples; a command that was dropped counts as one.
    pub contended_samples: u64,
}

/// Samples `taken..written` of an endless stream, at most as many as the capacity. The writer may
/// break the stream off: the reader goes on after [`Line::cleared`], and what was before is room at
/// once.
///
/// That room may be filled while the reader is still copying out of it. So a reader asks
/// [`Line::is_cut`] after the copy and forgets what it copied if the line was cleared meanwhile.
pub struct Line {
    /// Bits of floats.
    samples: Box<[AtomicU32]>,
    written: AtomicU64,
    taken: AtomicU64,
    cleared: AtomicU64,
    present: AtomicBool,
    lag: AtomicUsize,
    pub(super) counts: Counts,
}

/// An end that sound is pushed into.
pub trait Input {
    /// Where what was pushed waits.
    fn line(&self) -> &Line;

    /// Absent and empty. Waits for a push that is under way.
    fn reset(&self);
}

/// What writers count, as in [`VoiceStats`].
#[derive(Default)]
pub(super) struct Counts {
    pub(super) overflow: AtomicU64,
    pub(super) clipped: AtomicU64,
    pub(super) non_finite: AtomicU64,
    pub(super) bad_rate: AtomicU64,
    pub(super) contended: AtomicU64,
}

/// The line as a reader found it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Glimpse {
    pub(super) present: bool,
    /// Samples before this one are gone.
    pub(super) cleared: u64,
    pub(super) written: u64,
}

impl Line {
    pub(super) fn new(capacity: usize) -> Self {
        Self {
            samples: bytemuck::allocation::zeroed_slice_box(capacity),
            written: AtomicU64::new(0),
            taken: AtomicU64::new(0),
            cleared: AtomicU64::new(0),
            present: AtomicBool::new(false),
            lag: AtomicUsize::new(0),
            counts: Counts::default(),
        }
    }

    /// The memory of `count` samples from `at` on, in two pieces, and their length.
    fn pieces(&self, at: u64, count: usize) -> [&[AtomicU32]; 2] {
        let from = (at % self.samples.len() as u64) as usize;
        let first = count.min(self.samples.len() - from);
        [&self.samples[from..from + first], &self.samples[..count - first]]
    }

    /// Copies `piece` to the start of `clean`, within `clip`, silence for what is not finite;
    /// counts both and returns how many of the latter there were.
    pub(super) fn clean(&self, piece: &[f32], clip: f32, clean: &mut [f32]) -> usize {
        let bad = piece.iter().filter(|s| !s.is_finite()).count();
        let clipped = piece.iter().filter(|s| s.is_finite() && s.abs() > clip).count();
        self.counts.clipped.fetch_add(clipped as u64, Relaxed);
        self.counts.non_finite.fetch_add(bad as u64, Relaxed);
        let cleaned = |s: &f32| if s.is_finite() { s.clamp(-clip, clip) } else { 0.0 };
        clean.iter_mut().zip(piece).for_each(|(to, s)| *to = cleaned(s));
        bad
    }

    /// Appends what fits, and counts the rest. For the one writer, as all that follows up to
    /// [`Line::lag`].
    pub(super) fn push(&self, samples: &[f32]) {
        let written = self.written.load(Relaxed);
        // Acquire: the reader is done with what it says that it took.
        let start = self.taken.load(Acquire).max(self.cleared.load(Relaxed));
        let take = samples.len().min(self.samples.len() - (written - start) as usize);
        let places = self.pieces(written, take).into_iter().flatten();
        places.zip(samples).for_each(|(to, s)| to.store(s.to_bits(), Relaxed));
        self.written.store(written + take as u64, Release);
        self.counts.overflow.fetch_add((samples.len() - take) as u64, Relaxed);
    }

    /// Appends `count` zeros.
    pub(super) fn push_silence(&self, mut count: usize) {
        const ZEROS: [f32; 64] = [0.0; 64];
        while count > 0 {
            let piece = count.min(ZEROS.len());
            self.push(&ZEROS[..piece]);
            count -= piece;
        }
    }

    /// Drops what has not been taken.
    pub(super) fn clear(&self) {
        self.cleared.store(self.written.load(Relaxed), Release);
        // Whoever reads a sample that is written after this sees that the line was cleared (with
        // the fence in `is_cut`).
        fence(Release);
    }

    /// Makes the voice present: what was written before is seen by whoever sees this.
    pub(super) fn set_present(&self, present: bool) {
        self.present.store(present, Release);
    }

    pub(super) fn set_lag(&self, lag: usize) {
        self.lag.store(lag, Relaxed);
    }

    pub(super) fn lag(&self) -> usize {
        self.lag.load(Relaxed)
    }

    /// What there is. In this order: a voice that is seen to be present has its first sound, and
    /// what was cleared was written.
    pub(super) fn glimpse(&self) -> Glimpse {
        let present = self.present.load(Acquire);
        let cleared = self.cleared.load(Acquire);
        Glimpse { present, cleared, written: self.written.load(Acquire) }
    }

    /// Copies the samples from `at` on, which were seen to be there. For the one reader, as all
    /// that follows.
    pub(super) fn read(&self, at: u64, out: &mut [f32]) {
        let places = self.pieces(at, out.len()).into_iter().flatten();
        out.iter_mut().zip(places).for_each(|(to, from)| *to = f32::from_bits(from.load(Relaxed)));
    }

    /// Whether samples from `at` on, which were read before this, were cleared before or while they
    /// were read.
    pub(super) fn is_cut(&self, at: u64) -> bool {
        fence(Acquire);
        self.cleared.load(Relaxed) > at
    }

    /// Samples before `at` are room.
    pub(super) fn take(&self, at: u64) {
        self.taken.store(at, Release);
    }

    /// Whether all that was written has been taken or cleared.
    pub(super) fn is_drained(&self) -> bool {
        self.written.load(Acquire) <= self.taken.load(Acquire).max(self.cleared.load(Acquire))
    }

    /// What was counted; underruns are the reader's to count.
    pub(super) fn stats(&self) -> VoiceStats {
        let Counts { overflow, clipped, non_finite, bad_rate, contended } = &self.counts;
        VoiceStats {
            underrun_samples: 0,
            overflow_samples: overflow.load(Relaxed),
            clipped_samples: clipped.load(Relaxed),
            non_finite_samples: non_finite.load(Relaxed),
            bad_rate_samples: bad_rate.load(Relaxed),
            contended_samples: contended.load(Relaxed),
        }
    }

    /// Counts from zero.
    pub(super) fn forget_counts(&self) {
        let Counts { overflow, clipped, non_finite, bad_rate, contended } = &self.counts;
        [overflow, clipped, non_finite, bad_rate, contended].into_iter().for_each(|count| count.store(0, Relaxed));
    }
}
