//! The reference: that of f32 weights, each weight widened.

use half::f16;

use super::{Job, Tile, body};

pub(super) fn run(job: &Job<'_, f16>, tile: &mut Tile<f32>) {
    job.check();
    body(job, tile, f16::to_f32_const);
}
