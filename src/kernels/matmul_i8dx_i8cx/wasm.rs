//! Products of bytes as pairs of 16 bits, at both levels. Relaxed dot products are not used: where
//! an engine's first and second compiler disagree about them (V8 of Node 20 does), no trial at the
//! start can tell what later blocks will get.

use std::arch::wasm32::*;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;

/// Rows of one panel whose accumulators fit the registers, beside their activations.
const ROOM: usize = 2;

/// Even and odd bytes of a word, widened to 16 bits.
#[inline(always)]
fn pairs(bytes: v128) -> [v128; 2] {
    [i16x8_shr(i16x8_shl(bytes, 8), 8), i16x8_shr(bytes, 8)]
}

/// Adds to each lane of 32 bits the four products of its bytes.
#[inline(always)]
fn add(sum: v128, w: [v128; 2], x: [v128; 2]) -> v128 {
    i32x4_add(sum, i32x4_add(i32x4_dot_i16x8(w[0], x[0]), i32x4_dot_i16x8(w[1], x[1])))
}

pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, ROOM, R in [1 2], P in [1],
        |r, p| block::<R>(job, (r, p), tile)
    );
}

/// Rows from `from.0`, panel `from.1` of the job.
#[inline(never)]
fn block<const R: usize>(job: &Job<'_>, from: (usize, usize), tile: &mut Tile<i32>) {
    let (padded, stride) = (job.geo.padded, job.x.stride);
    let weights = job.weights[(job.panels.first + from.1) * job.geo.panel..][..NR * padded].as_ptr();
    let q = job.x.q[from.0 * stride..][..R * stride].as_ptr();
    let mut acc = [[i32x4_splat(0); 4]; R];
    // Sixteen columns at a time.
    for k in (0..padded).step_by(16) {
        for j in 0..4 {
            let mut x = [[i32x4_splat(0); 2]; R];
            for r in 0..R {
                // SAFETY: 4 bytes at column k + 4 j of row r, within R rows, `stride` apart.
                x[r] = pairs(unsafe { v128_load32_splat(q.add(r * stride + k + 4 * j).cast()) });
            }
            for i in 0..4 {
                // SAFETY: 16 of the 64 bytes of columns k + 4 j .. k + 4 j + 4 of the panel.
                let w = pairs(unsafe { v128_load(weights.add(NR * k + 64 * j + 16 * i).cast()) });
                for r in 0..R {
                    acc[r][i] = add(acc[r][i], w, x[r]);
                }
            }
        }
    }
    for r in 0..R {
        let out = &mut tile[from.0 + r][from.1 * NR..][..NR];
        for i in 0..4 {
            // SAFETY: 16 values at `out`.
            unsafe { v128_store(out.as_mut_ptr().add(4 * i).cast(), acc[r][i]) };
        }
    }
}
