//! ARMv8.0: `smull` to i16, `addp` of the two products next to each other, `sadalp` into i32. A
//! pair's sum is at most 2 * 127 * 128 = 32,512, because activations stay within -127..=127.

use std::arch::aarch64::*;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;

/// Parts of a panel's columns that are read side by side.
const STREAMS: usize = 4;

#[target_feature(enable = "neon")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    for_blocks!(0..job.x.rows, job.panels.count, 4, R in [1 2 3 4], P in [1], |r, p| block::<R>(job, r, p, tile));
}

/// Rows from `row`, panel `p` of the job.
#[target_feature(enable = "neon")]
fn block<const R: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let padded = job.geo.padded;
    let weights = job.weights[(job.panels.first + p) * job.geo.panel..][..NR * padded].as_ptr().cast::<i8>();
    let q = job.x.q[row * job.x.stride..][..R * job.x.stride].as_ptr();
    let mut acc = [[vdupq_n_s32(0); 4]; R];
    let part = padded / 4 / STREAMS;
    for k in 0..part {
        for s in 0..STREAMS {
            let k = k + s * part;
            // SAFETY: line k < padded / 4 of the panel.
            let w: [int8x16_t; 4] = std::array::from_fn(|i| unsafe { vld1q_s8(weights.add(k * 64 + i * 16)) });
            for r in 0..R {
                // SAFETY: 4 bytes at column 4k of row r, within R rows, `stride` apart.
                let x = unsafe { q.add(r * job.x.stride + 4 * k).cast::<i32>().read_unaligned() };
                let x = vreinterpretq_s8_s32(vdupq_n_s32(x));
                for i in 0..4 {
                    let low = vmull_s8(vget_low_s8(w[i]), vget_low_s8(x));
                    let high = vmull_high_s8(w[i], x);
                    acc[r][i] = vpadalq_s16(acc[r][i], vpaddq_s16(low, high));
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        let out = &mut tile[row + r][p * NR..][..NR];
        for (i, acc) in acc.iter().enumerate() {
            // SAFETY: 16 values at `out`.
            unsafe { vst1q_s32(out.as_mut_ptr().add(4 * i), *acc) };
        }
    }
}
