use std::arch::x86_64::*;

use half::f16;

use super::{Job, Tile};
use crate::kernels::matmul_f32_f32::avx2::run_with;

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run(job: &Job<'_, f16>, tile: &mut Tile<f32>) {
    run_with(job, tile, |w| {
        // SAFETY: the pointer is to 16 weights of 2 bytes.
        let (low, high) = unsafe { (_mm_loadu_si128(w.cast()), _mm_loadu_si128(w.add(8).cast())) };
        [_mm256_cvtph_ps(low), _mm256_cvtph_ps(high)]
    });
}
