//! AVX-VNNI: the frame of the AVX2 variant with `vpdpbusd`, which sums in i32 at once.

use std::arch::x86_64::*;

use super::avx2::run_with;
use super::{Job, Tile};

#[target_feature(enable = "avx2,fma,f16c,avxvnni")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    run_with(job, tile, |acc, nibbles, x| _mm256_dpbusd_avx_epi32(acc, nibbles, x), |acc| acc);
}
