//! `smmla`: two rows of eight activations times two outputs of eight weights. A line's low and high
//! nibbles hold columns 0 to 3 and 4 to 7 of four outputs; interleaved by quads they are what the
//! instruction wants. An odd last row is paired with itself.

use std::arch::aarch64::*;

use super::{GROUP, Geometry, Job, NR, Tile};
use crate::kernels::matmul_i8dx_i8cx::i8mm::smmla;
use crate::kernels::packed::for_blocks;

#[target_feature(enable = "neon,i8mm")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    for_blocks!(
        0..job.x.rows.div_ceil(2), job.panels.count, 2, PAIRS in [1 2], P in [1],
        |pair, p| block::<PAIRS>(job, 2 * pair, p, tile)
    );
}

/// `PAIRS` pairs of rows from `row`, panel `p` of the job.
#[target_feature(enable = "neon,i8mm")]
fn block<const PAIRS: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<f32>) {
    let (groups, panel) = (job.geo.groups, job.geo.panel);
    let start = (job.panels.first + p) * panel;
    let weights = job.weights[start..][..panel].as_ptr();
    let scales = job.scales[start / 2..][..panel / 2].as_ptr().cast::<u16>();
    let last = job.x.rows - 1;
    let index: [[usize; 2]; PAIRS] = std::array::from_fn(|i| [0, 1].map(|j| last.min(row + 2 * i + j)));
    let rows = index.map(|pair| pair.map(|r| job.x.q[r * job.x.stride..][..job.geo.padded()].as_ptr()));
    let sums = index.map(|pair| pair.map(|r| &job.x.sums[r * groups..][..groups]));
    let mut total = [[[vdupq_n_f32(0.0); 4]; 2]; PAIRS];
    for g in 0..groups {
        // Of each pair of rows, eight columns at a time.
        let x: [[int8x16_t; 4]; PAIRS] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let at = g * GROUP + 8 * j;
                // SAFETY: 8 bytes at a column of group g < groups of both rows.
                unsafe { vcombine_s8(vld1_s8(rows[i][0].add(at)), vld1_s8(rows[i][1].add(at))) }
            })
        });
        for quad in 0..4 {
            let mut acc = [[vdupq_n_s32(0); 2]; PAIRS];
            for j in 0..GROUP / 8 {
                // SAFETY: 16 bytes of line j of group g of the panel: outputs 4 quad .. 4 quad + 4.
                let w = unsafe { vld1q_u8(weights.add(Geometry::nibbles(g) + j * 64 + quad * 16)) };
                let low = vreinterpretq_u32_u8(vandq_u8(w, vdupq_n_u8(15)));
                let high = vreinterpretq_u32_u8(vshrq_n_u8::<4>(w));
                let w = [vzip1q_u32(low, high), vzip2q_u32(low, high)].map(|w| vreinterpretq_s8_u32(w));
                for i in 0..PAIRS {
                    acc[i] = [smmla(acc[i][0], x[i][j], w[0]), smmla(acc[i][1], x[i][j], w[1])];
                }
            }
            // SAFETY: 4 of the 16 scales of group g.
            let scale = unsafe { vld1_u16(scales.add(Geometry::scales(g) + quad * 4)) };
            let scale = vcvt_f32_f16(vreinterpret_f16_u16(scale));
            for i in 0..PAIRS {
                let [a, b] = acc[i];
                let both =
                    [vcombine_s32(vget_low_s32(a), vget_low_s32(b)), vcombine_s32(vget_high_s32(a), vget_high_s32(b))];
                for (j, dot) in both.into_iter().enumerate() {
                    let sum = vaddq_s32(dot, vdupq_n_s32(-8 * sums[i][j][g]));
                    total[i][j][quad] = vfmaq_f32(total[i][j][quad], scale, vcvtq_f32_s32(sum));
                }
            }
        }
    }
    for (i, pair) in total.iter().enumerate() {
        for (j, total) in pair.iter().enumerate() {
            let r = row + 2 * i + j;
            if r > last {
                continue;
            }
            let out = &mut tile[r][p * NR..][..NR];
            for (quad, total) in total.iter().enumerate() {
                // SAFETY: 16 values at `out`.
                unsafe { vst1q_f32(out.as_mut_ptr().add(4 * quad), *total) };
            }
        }
    }
}
