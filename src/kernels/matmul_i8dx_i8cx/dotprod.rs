//! `sdot`: each i32 lane gains four products of its four bytes with one quad of the activations,
//! chosen by lane.

use std::arch::aarch64::*;
use std::arch::asm;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;

/// Parts of a panel's columns that are read side by side.
const STREAMS: usize = 2;

/// acc + products of each lane's four bytes of `w` with quad `LANE` of `x`; the intrinsic is not
/// stable yet.
#[target_feature(enable = "neon,dotprod")]
pub(crate) fn sdot<const LANE: usize>(mut acc: int32x4_t, w: int8x16_t, x: int8x16_t) -> int32x4_t {
    // SAFETY: one register-only instruction of a feature that this function requires.
    unsafe {
        asm!("sdot {a:v}.4s, {w:v}.16b, {x:v}.4b[{lane}]", a = inout(vreg) acc, w = in(vreg) w, x = in(vreg) x,
            lane = const LANE, options(pure, nomem, nostack, preserves_flags));
    }
    acc
}

/// Accumulators fit 24 of 32 registers: 4 panels of 1 row, 2 of 2 or 3, 1 of up to 6.
#[target_feature(enable = "neon,dotprod")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, 6, R in [1 2 3 4 5 6], P in [4 2 1],
        |r, p| block::<R, P>(job, r, p, tile)
    );
}

/// Rows from `row`, panels from `p` of the job.
#[target_feature(enable = "neon,dotprod")]
fn block<const R: usize, const P: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let padded = job.geo.padded;
    let weights = job.weights[(job.panels.first + p) * job.geo.panel..][..P * job.geo.panel].as_ptr().cast::<i8>();
    let q = job.x.q[row * job.x.stride..][..R * job.x.stride].as_ptr();
    let mut acc = [[[vdupq_n_s32(0); 4]; P]; R];
    // Sixteen columns at a time: four lines of weights, one register of activations a row.
    let part = padded / 16 / STREAMS;
    for k in 0..part {
        for s in 0..STREAMS {
            let k = k + s * part;
            // SAFETY: columns 16k .. 16k + 16 of row r, within R rows, `stride` apart.
            let x: [int8x16_t; R] = std::array::from_fn(|r| unsafe { vld1q_s8(q.add(r * job.x.stride + 16 * k)) });
            for c in 0..P {
                for i in 0..4 {
                    // SAFETY: 16 bytes of each of the lines 4k .. 4k + 4 of panel c, within the
                    // slice.
                    let w: [int8x16_t; 4] = std::array::from_fn(|j| unsafe {
                        vld1q_s8(weights.add(c * job.geo.panel + (4 * k + j) * 64 + i * 16))
                    });
                    for r in 0..R {
                        let mut a = acc[r][c][i];
                        a = sdot::<0>(a, w[0], x[r]);
                        a = sdot::<1>(a, w[1], x[r]);
                        a = sdot::<2>(a, w[2], x[r]);
                        acc[r][c][i] = sdot::<3>(a, w[3], x[r]);
                    }
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        for (c, acc) in acc.iter().enumerate() {
            let out = &mut tile[row + r][(p + c) * NR..][..NR];
            for (i, acc) in acc.iter().enumerate() {
                // SAFETY: 16 values at `out`.
                unsafe { vst1q_s32(out.as_mut_ptr().add(4 * i), *acc) };
            }
        }
    }
}
