//! The frame of the NEON variant with `sdot`, which sums in i32 at once.

use std::arch::aarch64::*;

use super::neon::run_with;
use super::{Job, Tile};
use crate::kernels::matmul_i8dx_i8cx::dotprod::sdot;

#[target_feature(enable = "neon,dotprod")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    run_with(job, tile, |w, x, i| {
        // SAFETY: the 32 activations at x.
        let (x, y) = unsafe { (vld1q_s8(x), vld1q_s8(x.add(16))) };
        let low = |j: usize| vreinterpretq_s8_u8(vandq_u8(w[4 * j + i], vdupq_n_u8(15)));
        let high = |j: usize| vreinterpretq_s8_u8(vshrq_n_u8::<4>(w[4 * j + i]));
        let mut acc = vdupq_n_s32(0);
        acc = sdot::<1>(sdot::<0>(acc, low(0), x), high(0), x);
        acc = sdot::<3>(sdot::<2>(acc, low(1), x), high(1), x);
        acc = sdot::<1>(sdot::<0>(acc, low(2), y), high(2), y);
        sdot::<3>(sdot::<2>(acc, low(3), y), high(3), y)
    });
}
