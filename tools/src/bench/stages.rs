//! Time by stage, from the session's own probe.

use serde::Serialize;
use std::time::Instant;
use visavis::internals::session::Probe;

/// Names of the stages, in the order of the data flow.
pub const STAGES: [&str; 4] = ["audio", "flow", "decoder", "pose"];

/// Times of the stages of blocks, milliseconds. The probe's own work (copying a few kilobytes for
/// each stage) is in them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct StageTimes {
    /// Both voices and the user's place.
    pub audio: f64,
    /// All evaluations of the flow network; of the kind `dram`, the steps.
    pub flow: f64,
    /// The decoder, and a share of re-anchoring where one is under way; 0 for the kind `dram`.
    pub decoder: f64,
    /// Features to frames.
    pub pose: f64,
    #[serde(skip)]
    last: Option<Instant>,
}

impl StageTimes {
    /// A block begins: the next stage is timed from here.
    pub fn start(&mut self) {
        self.last = Some(Instant::now());
    }

    /// Sums over `blocks` blocks as means.
    pub(super) fn mean(mut self, blocks: usize) -> Self {
        let scale = 1.0 / blocks.max(1) as f64;
        for time in [&mut self.audio, &mut self.flow, &mut self.decoder, &mut self.pose] {
            *time *= scale;
        }
        Self { last: None, ..self }
    }

    /// In the order of [`STAGES`].
    pub fn all(&self) -> [f64; 4] {
        [self.audio, self.flow, self.decoder, self.pose]
    }
}

impl Probe for StageTimes {
    fn stage(&mut self, _block: u64, name: &'static str, _values: &[f32]) {
        let Some(last) = self.last.replace(Instant::now()) else { return };
        let spent = 1000.0 * last.elapsed().as_secs_f64();
        match name {
            "x1" | "latents" | "user_rows" | "m" | "d" | "delta" | "poses" => self.flow += spent,
            "decoded" => self.decoder += spent,
            "roots" | "positions" | "rotations" | "dyadic" => self.pose += spent,
            _ => self.audio += spent,
        }
    }
}
