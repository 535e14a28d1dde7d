//! What is counted of sounds in the room.

use crate::audio::VoiceStats;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

/// What was counted of sounds in the room since the session started; 24 kHz samples unless said
/// otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SoundStats {
    /// Pushes that were taken, whole or in part.
    pub pieces: u64,
    /// Sources that began to sound, and how often ears began to hear.
    pub started: u64,
    /// Dropped because a source, or a host's ears (samples of both), was more than ten seconds
    /// ahead.
    pub overflow_samples: u64,
    /// Clipped to 64 pascals, input samples: a sign of integers pushed as floats.
    pub clipped_samples: u64,
    /// NaN or infinity, which silence replaced, input samples.
    pub non_finite_samples: u64,
    /// Pushed at a rate out of range and not taken, input samples.
    pub bad_rate_samples: u64,
    /// Pushes with a place that is no number or absurdly far: their sound is heard from where the
    /// source was before, or, of one that is new, not at all.
    pub bad_places: u64,
    /// Dropped because another thread was inside the same source's input and lost its core there
    /// for long, or pushed the same ears at that moment, input samples.
    pub contended_samples: u64,
    /// Pushes that were dropped because too many sources sounded or waited, and sources that were
    /// dropped because sixteen louder ones sounded.
    pub refused: u64,
    /// Sources that gave way to a louder one.
    pub replaced: u64,
}

/// What the pushing side counts for all sources together.
#[derive(Debug, Default)]
pub(super) struct Counts {
    pub(super) pieces: AtomicU64,
    pub(super) bad_rate: AtomicU64,
    pub(super) bad_places: AtomicU64,
    pub(super) refused: AtomicU64,
}

impl Counts {
    pub(super) fn reset(&self) {
        let Self { pieces, bad_rate, bad_places, refused } = self;
        [pieces, bad_rate, bad_places, refused].into_iter().for_each(|count| count.store(0, Relaxed));
    }
}

impl SoundStats {
    /// Those of all sources together; `streams` are their streams' counters.
    pub(super) fn of(counts: &Counts, streams: impl Iterator<Item = VoiceStats>) -> Self {
        let load = |count: &AtomicU64| count.load(Relaxed);
        let mut all = Self {
            pieces: load(&counts.pieces),
            bad_rate_samples: load(&counts.bad_rate),
            bad_places: load(&counts.bad_places),
            refused: load(&counts.refused),
            ..Self::default()
        };
        for stream in streams {
            all.overflow_samples += stream.overflow_samples;
            all.clipped_samples += stream.clipped_samples;
            all.non_finite_samples += stream.non_finite_samples;
            all.bad_rate_samples += stream.bad_rate_samples;
            all.contended_samples += stream.contended_samples;
        }
        all
    }
}
