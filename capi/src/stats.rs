//! Statistics.

use crate::session::{VisavisSession, with};
use crate::status::VisavisStatus;
use crate::structs::{Sized32, sized_struct};
use visavis::stats::{SessionStats, VoiceStats};

/// Counters of a voice, 24 kHz samples unless said otherwise.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct VisavisVoiceStats {
    /// Silence in place of sound that had not come, while the voice was present.
    pub underrun_samples: u64,
    /// Dropped because so much sound was waiting already, a minute by default.
    pub overflow_samples: u64,
    /// Clipped to 8 times full scale, input samples: a sign of integers pushed as floats.
    pub clipped_samples: u64,
}

/// Statistics of a session since its start or reset. Set struct_size before the call.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct VisavisStats {
    /// sizeof(visavis_stats).
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Blocks computed.
    pub blocks: u64,
    /// Computation time of a block over the last 4096: median, milliseconds.
    pub block_ms_p50: f64,
    /// 95th percentile.
    pub block_ms_p95: f64,
    /// 99th percentile.
    pub block_ms_p99: f64,
    /// Maximum.
    pub block_ms_max: f64,
    /// From something that the user does to the start of the first block that can answer, at most,
    /// milliseconds.
    pub user_delay_ms: f64,
    /// The same for the agent's own voice; 0 when it is known ahead.
    pub agent_delay_ms: f64,
    /// Times that recent motion was encoded anew.
    pub anchorings: u64,
    /// Bytes of all key-value caches.
    pub cache_bytes: u64,
    /// The agent's voice.
    pub agent_voice: VisavisVoiceStats,
    /// The user's voice.
    pub user_voice: VisavisVoiceStats,
    /// Head positions that were taken.
    pub head_accepted: u64,
    /// Ignored: not finite.
    pub head_non_finite: u64,
    /// Ignored: late (a block has used one of that time or later), or at the time of another.
    pub head_out_of_order: u64,
    /// Ignored: more than 1 km from the origin, or a time of more than 10 million seconds.
    pub head_absurd: u64,
    /// Taken, but too far from the one before to have walked there.
    pub head_teleports: u64,
    /// Dropped to make room before they were asked for.
    pub head_overwritten: u64,
    /// Blocks that took longer than the budget; this and the next four are 0 without a budget.
    pub governor_missed: u64,
    /// Changes to a cheaper sampler.
    pub governor_down: u64,
    /// Changes to a better sampler.
    pub governor_up: u64,
    /// Blocks whose motion was held because even the cheapest sampler took too long.
    pub governor_held_blocks: u64,
    /// Passes spent on bringing skipped flow times up to date.
    pub governor_catch_up_passes: u64,
    /// Times that the plausibility guard took over.
    pub guard_trips: u64,
    /// Frames that it held, or faded back.
    pub guard_held_frames: u64,
    /// Since interface 1.1. The agent's voice, input samples: not finite, which silence replaced.
    pub agent_non_finite_samples: u64,
    /// Pushed at a rate out of range and not taken.
    pub agent_bad_rate_samples: u64,
    /// Dropped because another thread was inside this voice's input and lost its core there for
    /// long; a command that was dropped counts as one.
    pub agent_contended_samples: u64,
    /// The same for the user's voice.
    pub user_non_finite_samples: u64,
    /// See agent_bad_rate_samples.
    pub user_bad_rate_samples: u64,
    /// See agent_contended_samples.
    pub user_contended_samples: u64,
    /// Since interface 1.2. Blocks that the fallback made instead of a pose being held
    /// (visavis_session_set_fallback).
    pub governor_fallback_blocks: u64,
    /// Since interface 1.3. Pushes of sounds in the room that were taken, whole or in part; this and
    /// the next nine are 0 where the bundle has no hearing.
    pub sound_pieces: u64,
    /// Sources that began to sound.
    pub sound_started: u64,
    /// Dropped because a source was more than ten seconds ahead, 24 kHz samples.
    pub sound_overflow_samples: u64,
    /// Clipped to 64 pascals, input samples: a sign of integers pushed as floats.
    pub sound_clipped_samples: u64,
    /// Not finite, which silence replaced, input samples.
    pub sound_non_finite_samples: u64,
    /// Pushed at a rate out of range and not taken, input samples.
    pub sound_bad_rate_samples: u64,
    /// Pushes with a place that is no number or absurdly far.
    pub sound_bad_places: u64,
    /// Dropped because another thread was inside the same source's input and lost its core there
    /// for long, input samples.
    pub sound_contended_samples: u64,
    /// Pushes and sources that were dropped because too many, or sixteen louder ones, sounded.
    pub sound_refused: u64,
    /// Sources that gave way to a louder one.
    pub sound_replaced: u64,
    /// Of test builds.
    #[cfg(feature = "grown")]
    pub grown: u64,
}

sized_struct!(VisavisStats, "visavis_stats", 232);
// A part of the statistics, and so of this size for ever.
const _: () = assert!(size_of::<VisavisVoiceStats>() == 24);

impl From<VoiceStats> for VisavisVoiceStats {
    fn from(v: VoiceStats) -> Self {
        Self {
            underrun_samples: v.underrun_samples,
            overflow_samples: v.overflow_samples,
            clipped_samples: v.clipped_samples,
        }
    }
}

impl From<SessionStats> for VisavisStats {
    fn from(s: SessionStats) -> Self {
        let [block_ms_p50, block_ms_p95, block_ms_p99, block_ms_max] = s.block_ms;
        Self {
            struct_size: size_of::<Self>() as u32,
            reserved: 0,
            blocks: s.blocks,
            block_ms_p50,
            block_ms_p95,
            block_ms_p99,
            block_ms_max,
            user_delay_ms: s.delays.user_ms,
            agent_delay_ms: s.delays.agent_ms,
            anchorings: s.anchorings,
            cache_bytes: s.cache_bytes as u64,
            agent_voice: s.inputs.agent_voice.into(),
            user_voice: s.inputs.user_voice.into(),
            head_accepted: s.inputs.head.accepted,
            head_non_finite: s.inputs.head.non_finite,
            head_out_of_order: s.inputs.head.out_of_order,
            head_absurd: s.inputs.head.absurd,
            head_teleports: s.inputs.head.teleports,
            head_overwritten: s.inputs.head.overwritten,
            governor_missed: s.governor.missed,
            governor_down: s.governor.down,
            governor_up: s.governor.up,
            governor_held_blocks: s.governor.held_blocks,
            governor_catch_up_passes: s.governor.catch_up_passes,
            guard_trips: s.guard.trips,
            guard_held_frames: s.guard.held_frames,
            agent_non_finite_samples: s.inputs.agent_voice.non_finite_samples,
            agent_bad_rate_samples: s.inputs.agent_voice.bad_rate_samples,
            agent_contended_samples: s.inputs.agent_voice.contended_samples,
            user_non_finite_samples: s.inputs.user_voice.non_finite_samples,
            user_bad_rate_samples: s.inputs.user_voice.bad_rate_samples,
            user_contended_samples: s.inputs.user_voice.contended_samples,
            governor_fallback_blocks: s.governor.fallback_blocks,
            sound_pieces: s.inputs.sounds.pieces,
            sound_started: s.inputs.sounds.started,
            sound_overflow_samples: s.inputs.sounds.overflow_samples,
            sound_clipped_samples: s.inputs.sounds.clipped_samples,
            sound_non_finite_samples: s.inputs.sounds.non_finite_samples,
            sound_bad_rate_samples: s.inputs.sounds.bad_rate_samples,
            sound_bad_places: s.inputs.sounds.bad_places,
            sound_contended_samples: s.inputs.sounds.contended_samples,
            sound_refused: s.inputs.sounds.refused,
            sound_replaced: s.inputs.sounds.replaced,
            #[cfg(feature = "grown")]
            grown: crate::structs::GROWN,
        }
    }
}

/// Fills `stats`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_stats(
    session: *const VisavisSession,
    stats: *mut VisavisStats,
) -> VisavisStatus {
    // SAFETY: the header's promise, twice.
    unsafe { with(session, |s| VisavisStats::write(stats, &s.stats().into())) }
}
