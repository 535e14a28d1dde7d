//! ARMv8.0: the eight products of an i16 lane, each at most 15 * 127, add up to at most 15,240, so a group is summed by `smlal`
//! in i16 and widened once.

use std::arch::aarch64::*;

use super::{GROUP, Geometry, Job, NR, Tile};

#[target_feature(enable = "neon")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    run_with(job, tile, |w, x, i| {
        let mut acc = [vdupq_n_s16(0); 2];
        for j in 0..GROUP / 8 {
            let both = [vandq_u8(w[4 * j + i], vdupq_n_u8(15)), vshrq_n_u8::<4>(w[4 * j + i])];
            for (half, nibbles) in both.into_iter().enumerate() {
                let nibbles = vreinterpretq_s8_u8(nibbles);
                // SAFETY: 4 bytes of the 32 at x.
                let x = unsafe { x.add(8 * j + 4 * half).cast::<i32>().read_unaligned() };
                let x = vreinterpretq_s8_s32(vdupq_n_s32(x));
                acc[0] = vmlal_s8(acc[0], vget_low_s8(nibbles), vget_low_s8(x));
                acc[1] = vmlal_high_s8(acc[1], nibbles, x);
            }
        }
        vpaddq_s32(vpaddlq_s16(acc[0]), vpaddlq_s16(acc[1]))
    });
}

/// The product on 128 bits: `dot(w, x, i)` sums the products of outputs 4i .. 4i + 4, whose nibbles are registers i, 4 + i, 8 + i and
/// 12 + i of `w`, with the 32 activations at `x`.
#[target_feature(enable = "neon")]
pub(super) fn run_with(
    job: &Job<'_>,
    tile: &mut Tile<f32>,
    dot: impl Fn(&[uint8x16_t; 16], *const i8, usize) -> int32x4_t + Copy,
) {
    job.check();
    for p in 0..job.panels {
        for r in (0..job.rows).step_by(4) {
            match job.rows - r {
                1 => block::<1>(job, (r, p), tile, dot),
                2 => block::<2>(job, (r, p), tile, dot),
                3 => block::<3>(job, (r, p), tile, dot),
                _ => block::<4>(job, (r, p), tile, dot),
            }
        }
    }
}

/// Rows from `from.0`, panel `from.1` of the job.
#[target_feature(enable = "neon")]
fn block<const R: usize>(
    job: &Job<'_>,
    from: (usize, usize),
    tile: &mut Tile<f32>,
    dot: impl Fn(&[uint8x16_t; 16], *const i8, usize) -> int32x4_t + Copy,
) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.stride);
    let start = (job.first + from.1) * panel;
    let weights = job.weights[start..][..panel].as_ptr();
    let scales = job.scales[start / 2..][..panel / 2].as_ptr().cast::<u16>();
    let q = job.q[from.0 * stride..][..R * stride].as_ptr();
    let sums = &job.sums[from.0 * groups..][..R * groups];
    let mut total = [[vdupq_n_f32(0.0); 4]; R];
    for g in 0..groups {
        // SAFETY: the 256 bytes of group g of the panel.
        let w: [uint8x16_t; 16] =
            std::array::from_fn(|i| unsafe { vld1q_u8(weights.add(Geometry::nibbles(g) + i * 16)) });
        for i in 0..4 {
            // SAFETY: 4 of the 16 scales of group g.
            let scale = unsafe { vld1_u16(scales.add(Geometry::scales(g) + i * 4)) };
            let scale = vcvt_f32_f16(vreinterpret_f16_u16(scale));
            for r in 0..R {
                // SAFETY: group g of row r, within R rows, `stride` apart.
                let x = unsafe { q.add(r * stride + g * GROUP) };
                let sum = vaddq_s32(dot(&w, x, i), vdupq_n_s32(-8 * sums[r * groups + g]));
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
