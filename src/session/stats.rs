//! What a session tells about itself.

use super::GovernorStats;
use crate::audio::VoiceStats;
use crate::hearing::SoundStats;
use crate::pose::GuardStats;
use crate::user::TrackStats;
use std::time::Duration;

/// Block times that percentiles are taken over: the last ones, a little over nine minutes.
const WINDOW: usize = 4096;

/// Statistics of a session.
#[derive(Debug, Clone, Copy)]
pub struct SessionStats {
    /// Blocks computed since the start.
    pub blocks: u64,
    /// Computation time of a block over the last 4096 blocks: p50, p95, p99 and the maximum,
    /// milliseconds. Zeros before the first block.
    pub block_ms: [f64; 4],
    /// How old what a block knows is.
    pub delays: Delays,
    /// What was counted on the inputs.
    pub inputs: InputStats,
    /// Times that recent motion was encoded anew.
    pub anchorings: u64,
    /// What the governor did.
    pub governor: GovernorStats,
    /// What the plausibility guard met.
    pub guard: GuardStats,
    /// Bytes of all key-value caches; of the kind `dram`, of what its predictors remember.
    pub cache_bytes: usize,
}

/// Added delays, milliseconds, before the computation itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delays {
    /// From something the user does or says to the start of the first block that can answer: at
    /// most this long.
    pub user_ms: f64,
    /// The same for the agent's own voice: 0 when it is known ahead.
    pub agent_ms: f64,
    /// Look-ahead of the resampler of the user's voice, within `user_ms` of sound that is heard
    /// later; 0 at 24 kHz.
    pub user_resampler_ms: f64,
    /// Look-ahead of the resampler of the agent's voice.
    pub agent_resampler_ms: f64,
}

/// Counters of the inputs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct InputStats {
    /// The agent's voice.
    pub agent_voice: VoiceStats,
    /// The user's voice.
    pub user_voice: VoiceStats,
    /// The user's head.
    pub head: TrackStats,
    /// Sounds in the room; zeros where the bundle has no hearing.
    pub sounds: SoundStats,
}

/// The last block times.
#[derive(Debug)]
pub(super) struct BlockTimes {
    nanos: Vec<u64>,
    next: usize,
    len: usize,
}

impl BlockTimes {
    pub(super) fn new() -> Self {
        Self { nanos: vec![0; WINDOW], next: 0, len: 0 }
    }

    pub(super) fn clear(&mut self) {
        (self.next, self.len) = (0, 0);
    }

    pub(super) fn record(&mut self, time: Duration) {
        self.nanos[self.next] = time.as_nanos() as u64;
        self.next = (self.next + 1) % WINDOW;
        self.len = (self.len + 1).min(WINDOW);
    }

    /// p50, p95, p99 and maximum in milliseconds (nearest rank).
    pub(super) fn percentiles(&self) -> [f64; 4] {
        if self.len == 0 {
            return [0.0; 4];
        }
        let mut sorted = self.nanos[..self.len].to_vec();
        sorted.sort_unstable();
        [0.5, 0.95, 0.99, 1.0].map(|p| {
            let rank = (p * sorted.len() as f64).ceil() as usize;
            sorted[rank.clamp(1, sorted.len()) - 1] as f64 / 1e6
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_rank_over_the_last_blocks() {
        let mut times = BlockTimes::new();
        assert_eq!(times.percentiles(), [0.0; 4]);
        (1..=100).for_each(|ms| times.record(Duration::from_millis(ms)));
        assert_eq!(times.percentiles(), [50.0, 95.0, 99.0, 100.0]);
        (0..WINDOW).for_each(|_| times.record(Duration::from_millis(7)));
        assert_eq!(times.percentiles(), [7.0; 4]);
    }
}
