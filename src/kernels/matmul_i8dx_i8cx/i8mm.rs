//! `smmla`: two rows of eight activations times two outputs of eight weights, accumulated as the 2
//! x 2 block (row 0: outputs 0 and 1, row 1: outputs 0 and 1). An odd last row is paired with
//! itself and its second half dropped.

use std::arch::aarch64::*;
use std::arch::asm;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;

/// Parts of a panel's columns that are read side by side.
const STREAMS: usize = 4;

/// The intrinsic is not stable yet.
#[target_feature(enable = "neon,i8mm")]
pub(crate) fn smmla(mut acc: int32x4_t, x: int8x16_t, w: int8x16_t) -> int32x4_t {
    // SAFETY: one register-only instruction of a feature that this function requires.
    unsafe {
        asm!("smmla {a:v}.4s, {x:v}.16b, {w:v}.16b", a = inout(vreg) acc, x = in(vreg) x, w = in(vreg) w,
            options(pure, nomem, nostack, preserves_flags));
    }
    acc
}

#[target_feature(enable = "neon,i8mm")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    for_blocks!(
        0..job.x.rows.div_ceil(2), job.panels.count, 3, PAIRS in [1 2 3], P in [1],
        |pair, p| block::<PAIRS>(job, 2 * pair, p, tile)
    );
}

/// `PAIRS` pairs of rows from `row`, panel `p` of the job.
#[target_feature(enable = "neon,i8mm")]
fn block<const PAIRS: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let padded = job.geo.padded;
    let weights = job.weights[(job.panels.first + p) * job.geo.panel..][..NR * padded].as_ptr().cast::<i8>();
    let last = job.x.rows - 1;
    let rows: [[*const i8; 2]; PAIRS] =
        std::array::from_fn(|i| [0, 1].map(|j| job.x.q[last.min(row + 2 * i + j) * job.x.stride..][..padded].as_ptr()));
    let mut acc = [[vdupq_n_s32(0); 8]; PAIRS];
    let part = padded / 8 / STREAMS;
    for k in 0..part {
        for s in 0..STREAMS {
            let k = k + s * part;
            // SAFETY: columns 8k .. 8k + 8 of rows of `padded` bytes.
            let x: [int8x16_t; PAIRS] = std::array::from_fn(|i| unsafe {
                vcombine_s8(vld1_s8(rows[i][0].add(8 * k)), vld1_s8(rows[i][1].add(8 * k)))
            });
            for o in 0..8 {
                // SAFETY: outputs 2o and 2o + 1 of octet k < padded / 8 of the panel.
                let w = unsafe { vld1q_s8(weights.add(k * 128 + o * 16)) };
                for i in 0..PAIRS {
                    acc[i][o] = smmla(acc[i][o], x[i], w);
                }
            }
        }
    }
    for (i, acc) in acc.iter().enumerate() {
        for j in 0..2 {
            let r = row + 2 * i + j;
            if r > last {
                continue;
            }
            let out = &mut tile[r][p * NR..][..NR];
            for (o, acc) in acc.iter().enumerate() {
                let pair = if j == 0 { vget_low_s32(*acc) } else { vget_high_s32(*acc) };
                // SAFETY: 16 values at `out`.
                unsafe { vst1_s32(out.as_mut_ptr().add(2 * o), pair) };
            }
        }
    }
}
