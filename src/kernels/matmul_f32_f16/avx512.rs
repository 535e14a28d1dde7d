use std::arch::x86_64::*;

use half::f16;

use super::{Job, Tile};
use crate::kernels::matmul_f32_f32::avx512::run_with;

#[target_feature(enable = "avx512f")]
pub(super) fn run(job: &Job<'_, f16>, tile: &mut Tile<f32>) {
    // SAFETY: the pointer is to 16 weights of 2 bytes.
    run_with(job, tile, |w| _mm512_cvtph_ps(unsafe { _mm256_loadu_si256(w.cast()) }));
}
