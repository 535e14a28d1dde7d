//! ARMv8.0: the eight products of an i16 lane, each at most 15 * 127, add up to at most 15,240, so
//! a group is summed by `smlal` in i16 and widened once.

use std::arch::aarch64::*;

use super::{GROUP, Geometry, Job, NR, Tile};
use crate::kernels::packed::for_blocks;

#[target_feature(enable = "neon")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    run_with(job, tile, |w, x, start| {
        let mut acc = [vdupq_n_s16(0); 2];
        for (quad, w) in w.iter().enumerate() {
            // SAFETY: 4 bytes of the 32 at x.
            let x = unsafe { x.add(4 * quad).cast::<i32>().read_unaligned() };
            let x = vreinterpretq_s8_s32(vdupq_n_s32(x));
            acc[0] = vmlal_s8(acc[0], vget_low_s8(*w), vget_low_s8(x));
            acc[1] = vmlal_high_s8(acc[1], *w, x);
        }
        vaddq_s32(start, vpaddq_s32(vpaddlq_s16(acc[0]), vpaddlq_s16(acc[1])))
    });
}

/// The product on 128 bits: `dot(w, x, start)` adds to `start` the products of four outputs, whose
/// weights for columns 4k .. 4k + 4 are register k of `w`, with the 32 activations at `x`.
#[target_feature(enable = "neon")]
pub(super) fn run_with(
    job: &Job<'_>,
    tile: &mut Tile<f32>,
    dot: impl Fn(&[int8x16_t; GROUP / 4], *const i8, int32x4_t) -> int32x4_t + Copy,
) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, 4, R in [1 2 3 4], P in [1],
        |r, p| block::<R>(job, (r, p), tile, dot)
    );
}

/// Rows from `from.0`, panel `from.1` of the job.
#[target_feature(enable = "neon")]
fn block<const R: usize>(
    job: &Job<'_>,
    from: (usize, usize),
    tile: &mut Tile<f32>,
    dot: impl Fn(&[int8x16_t; GROUP / 4], *const i8, int32x4_t) -> int32x4_t + Copy,
) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.x.stride);
    let start = (job.panels.first + from.1) * panel;
    let weights = job.weights[start..][..panel].as_ptr();
    let scales = job.scales[start / 2..][..panel / 2].as_ptr().cast::<u16>();
    let q = job.x.q[from.0 * stride..][..R * stride].as_ptr();
    let sums = &job.x.sums[from.0 * groups..][..R * groups];
    let mut total = [[vdupq_n_f32(0.0); 4]; R];
    for g in 0..groups {
        for i in 0..4 {
            // Taken apart once for all rows.
            let mut w = [vdupq_n_s8(0); GROUP / 4];
            for j in 0..GROUP / 8 {
                // SAFETY: 16 of the 256 bytes of group g of the panel.
                let line = unsafe { vld1q_u8(weights.add(Geometry::nibbles(g) + j * 64 + i * 16)) };
                w[2 * j] = vreinterpretq_s8_u8(vandq_u8(line, vdupq_n_u8(15)));
                w[2 * j + 1] = vreinterpretq_s8_u8(vshrq_n_u8::<4>(line));
            }
            // SAFETY: 4 of the 16 scales of group g.
            let scale = unsafe { vld1_u16(scales.add(Geometry::scales(g) + i * 4)) };
            let scale = vcvt_f32_f16(vreinterpret_f16_u16(scale));
            for r in 0..R {
                // SAFETY: group g of row r, within R rows, `stride` apart.
                let x = unsafe { q.add(r * stride + g * GROUP) };
                let sum = dot(&w, x, vdupq_n_s32(-8 * sums[r * groups + g]));
                total[r][i] = vfmaq_f32(total[r][i], scale, vcvtq_f32_s32(sum));
            }
        }
    }
    for (r, total) in total.iter().enumerate() {
        let out = &mut tile[from.0 + r][from.1 * NR..][..NR];
        for (i, total) in total.iter().enumerate() {
            // SAFETY: 16 values at `out`.
            unsafe { vst1q_f32(out.as_mut_ptr().add(4 * i), *total) };
        }
    }
}
