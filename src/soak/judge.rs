//! Verdicts.

use super::{Figures, Soak, Voices};
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FPS, Frame, Sampler};
use crate::pose::DEFECTIVE_TRIPS_A_MINUTE;
use crate::session::{SessionOptions, SessionStats};
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;

/// Growth of resident memory that is allowed.
const MEMORY_GROWTH: f64 = 0.01;
/// Difference between the first and the last window that is allowed.
const DRIFT: f64 = 0.15;
/// Soaks that are shorter have windows too short to be compared, hours.
const DRIFT_HOURS: f64 = 0.5;
/// Supporting feet slower than this are compared by their difference as a share of it, m/s.
const SUPPORT: f64 = 0.02;
/// Difference that a day of token indices may make, metres.
const PRECISION: f64 = 0.005;
/// Blocks over which it is looked for: feedback amplifies the last bits without end.
const PRECISION_BLOCKS: usize = 20;

/// One thing that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// What.
    pub name: String,
    /// Whether it holds.
    pub passed: bool,
    /// Figures that say why.
    pub detail: String,
}

/// The outcome of a soak.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Hours of motion, and the hour at which they started.
    pub hours: f64,
    /// Hour of the session's time at which it started.
    pub from_hour: f64,
    /// Blocks computed.
    pub blocks: u64,
    /// Wall-clock seconds that it took.
    pub seconds: f64,
    /// Block times p50, p95, p99 and maximum of the last 4096 blocks, milliseconds.
    pub block_ms: [f64; 4],
    /// Times that the session re-anchored.
    pub anchorings: u64,
    /// Resident memory at its highest in the second and third tenth of the run, and after them, bytes; `None` where it cannot be told.
    pub resident_bytes: Option<[u64; 2]>,
    /// Allocations while blocks were computed, warm-up excepted; `None` where nobody counts.
    pub allocations: Option<u64>,
    /// Largest difference of a joint between hour 0 and hour 24, metres.
    pub day_difference: f64,
    /// Metrics of the first and of the last window.
    pub windows: [Figures; 2],
    /// What was judged.
    pub verdicts: Vec<Verdict>,
}

impl Report {
    /// Whether all verdicts hold.
    pub fn passed(&self) -> bool {
        self.verdicts.iter().all(|v| v.passed)
    }
}

/// Resident memory over a run.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Memory {
    first: Option<u64>,
    most: u64,
}

impl Memory {
    /// Looks once; `done` is the share of the run that is over.
    pub(super) fn sample(&mut self, done: f64) {
        let Some(bytes) = resident() else { return };
        match done {
            0.0..0.1 => {}
            0.1..0.3 => self.first = self.first.max(Some(bytes)),
            _ => self.most = self.most.max(bytes),
        }
    }
}

/// Resident bytes of this process, where the system tells.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}

#[allow(clippy::too_many_arguments, reason = "everything that was measured comes together here, once")]
pub(super) fn report(
    soak: &Soak,
    blocks: u64,
    seconds: f64,
    stats: &SessionStats,
    windows: [Figures; 2],
    memory: Memory,
    allocations: Option<u64>,
    day_difference: f64,
) -> Report {
    let mut verdicts = Vec::new();
    let mut judge = |name: &str, passed: bool, detail: String| {
        verdicts.push(Verdict { name: name.to_owned(), passed, detail });
    };
    let resident_bytes = memory.first.map(|first| [first, memory.most]);
    if let Some([first, most]) = resident_bytes {
        let growth = most as f64 / first as f64 - 1.0;
        let detail = format!(
            "{:.1} MB at most in the second and third tenth, {:.1} MB after them",
            first as f64 / 1e6,
            most as f64 / 1e6
        );
        judge("memory", growth <= MEMORY_GROWTH, detail);
    }
    if let Some(count) = allocations {
        judge("allocations", count == 0, format!("{count} while blocks were computed"));
    }
    for ((name, first), (_, last)) in windows[0].all().into_iter().zip(windows[1].all()) {
        let (Some(first), Some(last)) = (first, last) else { continue };
        let scale = if name == "support_foot_speed" { first.abs().max(SUPPORT) } else { first.abs() };
        if soak.hours < DRIFT_HOURS {
            break;
        }
        let drift = (last - first).abs() / scale.max(1e-9);
        judge(name, drift <= DRIFT, format!("{first:.4} at first, {last:.4} at last, {:.1} %", 100.0 * drift));
    }
    judge("precision", day_difference <= PRECISION, format!("{:.4} mm after a day", 1000.0 * day_difference));
    let guard = &stats.guard;
    let minutes = blocks as f64 * BLOCK_FRAMES as f64 / f64::from(FPS) / 60.0;
    let detail = format!("{} trips, {} frames held", guard.trips, guard.held_frames);
    judge("guard", guard.trips as f64 <= DEFECTIVE_TRIPS_A_MINUTE * minutes, detail);
    Report {
        hours: soak.hours,
        from_hour: soak.from_hour,
        blocks,
        seconds,
        block_ms: stats.block_ms,
        anchorings: stats.anchorings,
        resident_bytes,
        allocations,
        day_difference,
        windows,
        verdicts,
    }
}

/// Largest difference of a joint between a session at hour 0 and one at hour 24 with the same noise and inputs, metres.
pub(super) fn precision(engine: &Arc<Engine>, voices: &Voices, sampler: Sampler) -> Result<f64> {
    const DAY: u64 = 24 * 3600 * FPS as u64 / BLOCK_FRAMES as u64;
    let motion = |first_block: u64| -> Result<Vec<Frame>> {
        let mut session = engine.session(SessionOptions { first_block, sampler, ..SessionOptions::default() })?;
        let latent = engine.config().vae.latent;
        let mut noise = vec![0.0; (engine.idle_blocks() + PRECISION_BLOCKS) * latent];
        for (token, eps) in noise.chunks_exact_mut(latent).enumerate() {
            crate::flow::normal(7, token as u64, eps);
        }
        session.reset_with_noise(noise)?;
        let samples = PRECISION_BLOCKS * BLOCK_SAMPLES;
        session.push_agent_audio(&voices.agent()[..samples.min(voices.agent().len())], 24_000)?;
        session.push_user_head(Vec3::new(0.4, 1.65, 1.5), session.next_due())?;
        let mut frames = Vec::new();
        for _ in 0..PRECISION_BLOCKS {
            let due = session.next_due();
            frames.extend_from_slice(session.poll(due)?.unwrap_or_default());
        }
        Ok(frames)
    };
    let (now, later) = (motion(0)?, motion(DAY)?);
    let joints = now.iter().zip(&later).flat_map(|(a, b)| a.global.iter().zip(&b.global));
    Ok(joints.map(|(a, b)| f64::from(a.position.distance(b.position))).fold(0.0, f64::max))
}
