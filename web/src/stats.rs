//! Statistics of a session, as JSON.

use serde::Serialize;
use visavis::stats::{SessionStats, VoiceStats};

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Stats {
    blocks: u64,
    block_ms: Percentiles,
    user_delay_ms: f64,
    agent_delay_ms: f64,
    anchorings: u64,
    cache_bytes: usize,
    agent_voice: Voice,
    user_voice: Voice,
    head: Head,
    sounds: Sounds,
    governor: Governor,
    guard_trips: u64,
    guard_held_frames: u64,
}

#[derive(Serialize)]
struct Percentiles {
    p50: f64,
    p95: f64,
    p99: f64,
    max: f64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Voice {
    underrun_samples: u64,
    overflow_samples: u64,
    clipped_samples: u64,
    non_finite_samples: u64,
    bad_rate_samples: u64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    accepted: u64,
    non_finite: u64,
    out_of_order: u64,
    absurd: u64,
    teleports: u64,
    overwritten: u64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Sounds {
    pieces: u64,
    started: u64,
    overflow_samples: u64,
    clipped_samples: u64,
    non_finite_samples: u64,
    bad_rate_samples: u64,
    bad_places: u64,
    refused: u64,
    replaced: u64,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Governor {
    missed: u64,
    down: u64,
    up: u64,
    held_blocks: u64,
    fallback_blocks: u64,
    catch_up_passes: u64,
}

impl From<VoiceStats> for Voice {
    fn from(v: VoiceStats) -> Self {
        Self {
            underrun_samples: v.underrun_samples,
            overflow_samples: v.overflow_samples,
            clipped_samples: v.clipped_samples,
            non_finite_samples: v.non_finite_samples,
            bad_rate_samples: v.bad_rate_samples,
        }
    }
}

pub(crate) fn json(s: &SessionStats) -> String {
    let [p50, p95, p99, max] = s.block_ms;
    let (h, g, v) = (s.inputs.head, s.governor, s.inputs.sounds);
    let stats = Stats {
        blocks: s.blocks,
        block_ms: Percentiles { p50, p95, p99, max },
        user_delay_ms: s.delays.user_ms,
        agent_delay_ms: s.delays.agent_ms,
        anchorings: s.anchorings,
        cache_bytes: s.cache_bytes,
        agent_voice: s.inputs.agent_voice.into(),
        user_voice: s.inputs.user_voice.into(),
        head: Head {
            accepted: h.accepted,
            non_finite: h.non_finite,
            out_of_order: h.out_of_order,
            absurd: h.absurd,
            teleports: h.teleports,
            overwritten: h.overwritten,
        },
        sounds: Sounds {
            pieces: v.pieces,
            started: v.started,
            overflow_samples: v.overflow_samples,
            clipped_samples: v.clipped_samples,
            non_finite_samples: v.non_finite_samples,
            bad_rate_samples: v.bad_rate_samples,
            bad_places: v.bad_places,
            refused: v.refused,
            replaced: v.replaced,
        },
        governor: Governor {
            missed: g.missed,
            down: g.down,
            up: g.up,
            held_blocks: g.held_blocks,
            fallback_blocks: g.fallback_blocks,
            catch_up_passes: g.catch_up_passes,
        },
        guard_trips: s.guard.trips,
        guard_held_frames: s.guard.held_frames,
    };
    serde_json::to_string(&stats).expect("plain data")
}
