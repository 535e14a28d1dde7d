//! The frame of the NEON variant with `sdot`, which sums in i32 at once.

use std::arch::aarch64::*;

use super::neon::run_with;
use super::{Job, Tile};
use crate::kernels::matmul_i8dx_i8cx::dotprod::sdot;

#[target_feature(enable = "neon,dotprod")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    run_with(job, tile, |w, x, start| {
        // SAFETY: the 32 activations at x.
        let (x, y) = unsafe { (vld1q_s8(x), vld1q_s8(x.add(16))) };
        let acc = sdot::<1>(sdot::<0>(start, w[0], x), w[1], x);
        let acc = sdot::<3>(sdot::<2>(acc, w[2], x), w[3], x);
        let acc = sdot::<1>(sdot::<0>(acc, w[4], y), w[5], y);
        sdot::<3>(sdot::<2>(acc, w[6], y), w[7], y)
    });
}
