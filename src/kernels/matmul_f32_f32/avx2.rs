use std::arch::x86_64::*;

use super::{FloatGeometry, Job, Tile};
use crate::kernels::packed::{NR, SEGMENTS, for_rows};

/// Bytes ahead of each stream that are asked for.
const AHEAD: usize = 1024;

/// Registers of one panel: 16 lanes.
pub(crate) type Pair = [__m256; 2];

#[target_feature(enable = "avx2,fma")]
pub(super) fn run(job: &Job<'_, f32>, tile: &mut Tile<f32>) {
    // SAFETY: the pointer is to 16 weights.
    run_with(job, tile, |w| unsafe { [_mm256_loadu_ps(w), _mm256_loadu_ps(w.add(8))] });
}

/// The product for weights that `load` widens, given a pointer to 16 of them.
#[target_feature(enable = "avx2,fma")]
pub(crate) fn run_with<W>(job: &Job<'_, W>, tile: &mut Tile<f32>, load: impl Fn(*const W) -> Pair + Copy) {
    job.check();
    for_rows!(job.rows, R => rows::<R, W, _>(job, tile, load))
}

/// Accumulators fit 12 of 16 registers: 4 panels of 1 row, 2 of 2 or 3, 1 of up to 6; more rows go in portions over the same panel.
#[target_feature(enable = "avx2,fma")]
fn rows<const R: usize, W, L: Fn(*const W) -> Pair + Copy>(job: &Job<'_, W>, tile: &mut Tile<f32>, load: L) {
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
        if R <= 6 {
            block::<R, 1, W, L>(job, (0, p), tile, load);
        } else {
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
        }
        p += 1;
    }
}

/// Rows from `from.0`, panels from `from.1` of the job.
#[target_feature(enable = "avx2,fma")]
fn block<const R: usize, const P: usize, W, L: Fn(*const W) -> Pair + Copy>(
    job: &Job<'_, W>,
    from: (usize, usize),
    tile: &mut Tile<f32>,
    load: L,
) {
    let FloatGeometry { seg, seg_stride, panel } = job.geo;
    let stride = job.stride;
    let weights = job.weights[(job.first + from.1) * panel..][..P * panel].as_ptr();
    let x = job.x[from.0 * stride..][..R * stride].as_ptr();
    let mut acc = [[[_mm256_setzero_ps(); 2]; P]; R];
    for k in 0..seg {
        for s in 0..SEGMENTS {
            for c in 0..P {
                // SAFETY: 16 weights of column k of segment s of panel c, all within the slice; a prefetch may point anywhere.
                let w = unsafe {
                    let line = weights.add(c * panel + s * seg_stride + k * NR);
                    _mm_prefetch::<_MM_HINT_T0>(line.cast::<i8>().wrapping_add(AHEAD));
                    load(line)
                };
                for r in 0..R {
                    // SAFETY: column s * seg + k of row r, below `stride`.
                    let x = _mm256_set1_ps(unsafe { *x.add(r * stride + s * seg + k) });
                    for h in 0..2 {
                        acc[r][c][h] = _mm256_fmadd_ps(x, w[h], acc[r][c][h]);
                    }
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        for (c, acc) in acc.iter().enumerate() {
            let out = &mut tile[from.0 + r][(from.1 + c) * NR..][..NR];
            // SAFETY: 16 values at `out`.
            unsafe {
                _mm256_storeu_ps(out.as_mut_ptr(), acc[0]);
                _mm256_storeu_ps(out.as_mut_ptr().add(8), acc[1]);
            }
        }
    }
}
