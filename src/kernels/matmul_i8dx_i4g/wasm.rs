//! The eight products of a lane of 16 bits, each pair at most 2 * 15 * 127, add up to at most
//! 30,480, so a group is summed in 16 bits and widened once.

use std::arch::wasm32::*;

use super::{GROUP, Geometry, Job, NR, Tile};
use crate::kernels::f32x16::F32x16;
use crate::kernels::packed::for_blocks;
use crate::kernels::wasm::Madd;

/// Rows of one panel whose accumulators fit the registers, beside their activations.
const ROOM: usize = 2;

/// Even and odd bytes of activations, widened.
#[inline(always)]
fn pairs(x: v128) -> [v128; 2] {
    [i16x8_shr(i16x8_shl(x, 8), 8), i16x8_shr(x, 8)]
}

/// Adds to each of the eight lanes of `sum` its two products with nibbles.
#[inline(always)]
fn add(sum: v128, nibbles: v128, x: [v128; 2]) -> v128 {
    let (even, odd) = (v128_and(nibbles, i16x8_splat(15)), u16x8_shr(nibbles, 8));
    i16x8_add(sum, i16x8_add(i16x8_mul(even, x[0]), i16x8_mul(odd, x[1])))
}

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, ROOM, R in [1 2], P in [1],
        |r, p| block::<L, R>(level, job, (r, p), tile)
    );
}

/// Rows from `from.0`, panel `from.1` of the job.
#[inline(never)]
fn block<L: Madd, const R: usize>(level: L, job: &Job<'_>, from: (usize, usize), tile: &mut Tile<f32>) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.x.stride);
    let start = (job.panels.first + from.1) * panel;
    let weights = job.weights[start..][..panel].as_ptr();
    let scales = job.scales[start / 2..][..panel / 2].as_chunks::<16>().0;
    let q = job.x.q[from.0 * stride..][..R * stride].as_ptr();
    let sums = &job.x.sums[from.0 * groups..][..R * groups];
    let low = i8x16_splat(15);
    let mut total = [level.zero(); R];
    for g in 0..groups {
        let mut acc = [[i16x8_splat(0); 4]; R];
        for j in 0..GROUP / 8 {
            let mut x = [[pairs(low); 2]; R];
            for r in 0..R {
                for h in 0..2 {
                    // SAFETY: 4 bytes of group g of row r, within R rows, `stride` apart.
                    let four = unsafe { v128_load32_splat(q.add(r * stride + g * GROUP + 8 * j + 4 * h).cast()) };
                    x[r][h] = pairs(four);
                }
            }
            for i in 0..4 {
                // SAFETY: 16 of the 256 bytes of group g of the panel.
                let w = unsafe { v128_load(weights.add(Geometry::nibbles(g) + j * 64 + i * 16).cast()) };
                let (a, b) = (v128_and(w, low), u8x16_shr(w, 4));
                for r in 0..R {
                    acc[r][i] = add(add(acc[r][i], a, x[r][0]), b, x[r][1]);
                }
            }
        }
        let scale = level.widen(&scales[Geometry::scales(g) / 16]);
        for r in 0..R {
            let offset = i32x4_splat(-8 * sums[r * groups + g]);
            let mut group = level.zero();
            for i in 0..4 {
                let sum = i32x4_add(offset, i32x4_extadd_pairwise_i16x8(acc[r][i]));
                group[i] = level.wide(f32x4_convert_i32x4(sum));
            }
            total[r] = level.madd(scale, group, total[r]);
        }
    }
    for r in 0..R {
        let row = tile[from.0 + r].as_chunks_mut().0;
        level.store(total[r], &mut row[from.1]);
    }
}
