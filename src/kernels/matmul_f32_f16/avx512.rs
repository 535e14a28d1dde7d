use super::{Job, Tile, body};
use half::f16;

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn run(job: &Job<'_, f16>, tile: &mut Tile<f32>) {
    job.check();
    body(job, tile, f16::to_f32);
}
