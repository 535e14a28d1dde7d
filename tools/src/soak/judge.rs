//! Verdicts.

use super::drift::Drift;
use super::{Figures, Hours, Soak};
use serde::Serialize;
use visavis::stats::SessionStats;
use visavis::{BLOCK_FRAMES, FPS};

/// Growth of resident memory that is allowed.
const MEMORY_GROWTH: f64 = 0.01;
/// Difference between the first and the last half of the cycles that is allowed beyond what chance
/// explains.
const DRIFT: f64 = 0.15;
/// Soaks that are shorter have cycles too short to be compared, hours.
const DRIFT_HOURS: f64 = 2.0 / 3.0;
/// Supporting feet slower than this are compared by their difference as a share of it, m/s.
const SUPPORT: f64 = 0.02;
/// Seam metric at switches of the sampler that is allowed.
pub(super) const SWITCH_SEAM: f64 = 1.2;
/// Distance by which a day of token indices may move joints of one block, root mean square, metres.
const PRECISION: f64 = 0.005;
/// How often what the first hours change a day may change; means of 32 places under eight noises
/// differ by a tenth by chance.
const DAY: f64 = 1.5;

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
    /// Resident memory at its highest in the second and third tenth of the run, and after them,
    /// bytes; `None` where it cannot be told.
    pub resident_bytes: Option<[u64; 2]>,
    /// Allocations while blocks were computed, warm-up excepted; `None` where nobody counts.
    pub allocations: Option<u64>,
    /// What the hour changes.
    pub hours_apart: Hours,
    /// Seam metric at switches of the sampler; `None` where nothing moves.
    pub switch_seam: Option<f64>,
    /// Metrics of the cycles, whole ones.
    pub cycles: Vec<Figures>,
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

/// Resident bytes of this process, where the system tells, but for pages of files: those of the
/// program come as its parts are first used, and go as the system likes.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    Some(1024 * line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?)
}

/// All that a soak measured.
pub(super) struct Measured {
    pub(super) blocks: u64,
    pub(super) seconds: f64,
    pub(super) stats: SessionStats,
    pub(super) cycles: Vec<Figures>,
    pub(super) memory: Memory,
    pub(super) allocations: Option<u64>,
    pub(super) hours: Hours,
    pub(super) switches: Option<f64>,
}

pub(super) fn report(soak: &Soak, measured: Measured) -> Report {
    let Measured { blocks, seconds, stats, cycles, memory, allocations, hours, switches } = measured;
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
    let judged = if soak.hours < DRIFT_HOURS { &[] } else { cycles.as_slice() };
    for (i, (name, _)) in Figures::default().all().into_iter().enumerate() {
        let values: Option<Vec<f64>> = judged.iter().map(|cycle| cycle.all()[i].1).collect();
        let Some(drift) = values.as_deref().and_then(Drift::of) else { continue };
        let scale = if name == "support_foot_speed" { drift.first.abs().max(SUPPORT) } else { drift.first.abs() };
        let (scale, difference) = (scale.max(1e-9), drift.last - drift.first);
        let detail = format!(
            "{:.4} in the first half, {:.4} in the last: {:+.1} % (standard error {:.1} %)",
            drift.first,
            drift.last,
            100.0 * difference / scale,
            100.0 * drift.error / scale
        );
        judge(name, drift.beyond_chance(scale) <= DRIFT, detail);
    }
    let detail = format!(
        "{} frames differ {:.1} days later",
        hours.period_frames_that_differ,
        hours.period_blocks as f64 * BLOCK_FRAMES as f64 / f64::from(FPS) / 86_400.0
    );
    judge("period", hours.period_frames_that_differ == 0, detail);
    let ([day, day_most], [first, first_most]) = (hours.day_later, hours.hours_later);
    let detail = format!(
        "a block moves by {:.3} mm (most {:.2}) in the hours after a day, by {:.3} mm (most {:.2}) in the first hours",
        1000.0 * day,
        1000.0 * day_most,
        1000.0 * first,
        1000.0 * first_most
    );
    judge("precision", day <= DAY * first && day <= PRECISION, detail);
    if let Some(seam) = switches {
        judge("switches", seam <= SWITCH_SEAM, format!("seam metric {seam:.2} where the sampler changes"));
    }
    let guard = &stats.guard;
    let detail = format!("{} trips, {} frames held", guard.trips, guard.held_frames);
    judge("guard", !guard.is_defective(blocks * BLOCK_FRAMES as u64), detail);
    Report {
        hours: soak.hours,
        from_hour: soak.from_hour,
        blocks,
        seconds,
        block_ms: stats.block_ms,
        anchorings: stats.anchorings,
        resident_bytes,
        allocations,
        hours_apart: hours,
        switch_seam: switches,
        cycles,
        verdicts,
    }
}
