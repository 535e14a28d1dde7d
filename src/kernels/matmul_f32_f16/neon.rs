use std::arch::aarch64::*;

use half::f16;

use super::{Job, Tile};
use crate::kernels::matmul_f32_f32::neon::run_with;

#[target_feature(enable = "neon")]
pub(super) fn run(job: &Job<'_, f16>, tile: &mut Tile<f32>) {
    run_with(job, tile, |w| {
        [0, 4, 8, 12].map(|i| {
            // SAFETY: the pointer is to 16 weights of 2 bytes.
            let half = unsafe { vld1_u16(w.cast::<u16>().add(i)) };
            vcvt_f32_f16(vreinterpret_f16_u16(half))
        })
    });
}
