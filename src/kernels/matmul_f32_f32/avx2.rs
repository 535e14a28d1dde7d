use super::{Job, Tile, scalar};

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run(job: &Job<'_, f32>, tile: &mut Tile<f32>) {
    job.check();
    scalar::body(job, tile, |w| w);
}
