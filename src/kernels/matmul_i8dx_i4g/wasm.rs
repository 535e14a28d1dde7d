//! Nibbles lie within the seven bits that every engine's `relaxed_dot` multiplies exactly; without
//! it, the eight products of a lane of 16 bits, each pair at most 2 * 15 * 127, are summed in pairs.

use std::arch::wasm32::*;

use super::{GROUP, Geometry, Job, NR, Tile};
use crate::kernels::f32x16::F32x16;
use crate::kernels::level::token;
use crate::kernels::packed::for_blocks;
use crate::kernels::wasm::Madd;

/// A way to add products of nibbles and bytes, on a level's token.
pub(super) trait Nibbles: Madd {
    /// Rows of one panel at a time.
    const ROWS: usize;

    /// Adds to each lane of `sum` the four products of its bytes.
    fn dot(self, sum: v128, nibbles: v128, x: v128) -> v128;
}

impl Nibbles for token::Simd128 {
    const ROWS: usize = 2;

    #[inline(always)]
    fn dot(self, sum: v128, nibbles: v128, x: v128) -> v128 {
        let (even, odd) = (v128_and(nibbles, i16x8_splat(15)), u16x8_shr(nibbles, 8));
        let (x_even, x_odd) = (i16x8_shr(i16x8_shl(x, 8), 8), i16x8_shr(x, 8));
        i32x4_add(sum, i32x4_add(i32x4_dot_i16x8(even, x_even), i32x4_dot_i16x8(odd, x_odd)))
    }
}

#[cfg(target_feature = "relaxed-simd")]
impl Nibbles for token::Relaxed {
    const ROWS: usize = 3;

    #[inline(always)]
    fn dot(self, sum: v128, nibbles: v128, x: v128) -> v128 {
        i32x4_relaxed_dot_i8x16_i7x16_add(x, nibbles, sum)
    }
}

#[inline(always)]
pub(super) fn run<L: Nibbles>(level: L, job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, L::ROWS, R in [1 2 3 4], P in [1],
        |r, p| block::<L, R>(level, job, (r, p), tile)
    );
}

/// Rows from `from.0`, panel `from.1` of the job.
#[inline(never)]
fn block<L: Nibbles, const R: usize>(level: L, job: &Job<'_>, from: (usize, usize), tile: &mut Tile<f32>) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.x.stride);
    let start = (job.panels.first + from.1) * panel;
    let weights = job.weights[start..][..panel].as_ptr();
    let scales = job.scales[start / 2..][..panel / 2].as_chunks::<16>().0;
    let q = job.x.q[from.0 * stride..][..R * stride].as_ptr();
    let sums = &job.x.sums[from.0 * groups..][..R * groups];
    let low = i8x16_splat(15);
    let mut total = [level.zero(); R];
    for g in 0..groups {
        let mut acc = [[i32x4_splat(0); 4]; R];
        for r in 0..R {
            acc[r] = [i32x4_splat(-8 * sums[r * groups + g]); 4];
        }
        for j in 0..GROUP / 8 {
            let mut x = [[low; 2]; R];
            for r in 0..R {
                for h in 0..2 {
                    // SAFETY: 4 bytes of group g of row r, within R rows, `stride` apart.
                    x[r][h] = unsafe { v128_load32_splat(q.add(r * stride + g * GROUP + 8 * j + 4 * h).cast()) };
                }
            }
            for i in 0..4 {
                // SAFETY: 16 of the 256 bytes of group g of the panel.
                let w = unsafe { v128_load(weights.add(Geometry::nibbles(g) + j * 64 + i * 16).cast()) };
                let (a, b) = (v128_and(w, low), u8x16_shr(w, 4));
                for r in 0..R {
                    acc[r][i] = level.dot(level.dot(acc[r][i], a, x[r][0]), b, x[r][1]);
                }
            }
        }
        let scale = level.widen(&scales[Geometry::scales(g) / 16]);
        for r in 0..R {
            let mut sums = level.zero();
            for i in 0..4 {
                sums[i] = level.wide(f32x4_convert_i32x4(acc[r][i]));
            }
            total[r] = level.madd16(scale, sums, total[r]);
        }
    }
    for r in 0..R {
        let row = tile[from.0 + r].as_chunks_mut().0;
        level.store(total[r], &mut row[from.1]);
    }
}
