use std::arch::aarch64::*;

use super::{FloatGeometry, Job, Tile};
use crate::kernels::packed::{NR, SEGMENTS, for_rows};

/// Registers of one panel: 16 lanes.
pub(crate) type Quad = [float32x4_t; 4];

#[target_feature(enable = "neon")]
pub(super) fn run(job: &Job<'_, f32>, tile: &mut Tile<f32>) {
    // SAFETY: the pointer is to 16 weights.
    run_with(job, tile, |w| [0, 4, 8, 12].map(|i| unsafe { vld1q_f32(w.add(i)) }));
}

/// The product for weights that `load` widens, given a pointer to 16 of them.
#[target_feature(enable = "neon")]
pub(crate) fn run_with<W>(job: &Job<'_, W>, tile: &mut Tile<f32>, load: impl Fn(*const W) -> Quad + Copy) {
    job.check();
    for_rows!(job.rows, R => rows::<R, W, _>(job, tile, load))
}

/// Accumulators fit 24 of 32 registers: 4 panels of 1 row, 2 of 2 or 3, 1 of up to 6; more rows go in portions over the same panel.
#[target_feature(enable = "neon")]
fn rows<const R: usize, W, L: Fn(*const W) -> Quad + Copy>(job: &Job<'_, W>, tile: &mut Tile<f32>, load: L) {
    let mut p = 0;
    while R == 1 && p + 4 <= job.panels {
        block::<R, 4, W, L>(job, (0, p), tile, load);
        p += 4;
    }
    while R <= 3 && p + 2 <= job.panels {
        block::<R, 2, W, L>(job, (0, p), tile, load);
        p += 2;
    }
    while p < job.panels {
        let mut r = 0;
        while R - r >= 6 {
            block::<6, 1, W, L>(job, (r, p), tile, load);
            r += 6;
        }
        match R - r {
            1 => block::<1, 1, W, L>(job, (r, p), tile, load),
            2 => block::<2, 1, W, L>(job, (r, p), tile, load),
            3 => block::<3, 1, W, L>(job, (r, p), tile, load),
            4 => block::<4, 1, W, L>(job, (r, p), tile, load),
            5 => block::<5, 1, W, L>(job, (r, p), tile, load),
            _ => {}
        }
        p += 1;
    }
}

/// Rows from `from.0`, panels from `from.1` of the job.
#[target_feature(enable = "neon")]
fn block<const R: usize, const P: usize, W, L: Fn(*const W) -> Quad + Copy>(
    job: &Job<'_, W>,
    from: (usize, usize),
    tile: &mut Tile<f32>,
    load: L,
) {
    let FloatGeometry { seg, seg_stride, panel } = job.geo;
    let stride = job.stride;
    let weights = job.weights[(job.first + from.1) * panel..][..P * panel].as_ptr();
    let x = job.x[from.0 * stride..][..R * stride].as_ptr();
    let mut acc = [[[vdupq_n_f32(0.0); 4]; P]; R];
    for k in 0..seg {
        for s in 0..SEGMENTS {
            for c in 0..P {
                // SAFETY: 16 weights of column k of segment s of panel c, all within the slice.
                let w = load(unsafe { weights.add(c * panel + s * seg_stride + k * NR) });
                for r in 0..R {
                    // SAFETY: column s * seg + k of row r, below `stride`.
                    let x = unsafe { *x.add(r * stride + s * seg + k) };
                    for i in 0..4 {
                        acc[r][c][i] = vfmaq_n_f32(acc[r][c][i], w[i], x);
                    }
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        for (c, acc) in acc.iter().enumerate() {
            let out = &mut tile[from.0 + r][(from.1 + c) * NR..][..NR];
            for (i, acc) in acc.iter().enumerate() {
                // SAFETY: 16 values at `out`.
                unsafe { vst1q_f32(out.as_mut_ptr().add(4 * i), *acc) };
            }
        }
    }
}
