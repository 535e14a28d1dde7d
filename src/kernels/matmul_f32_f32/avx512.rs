use std::arch::x86_64::*;

use super::{FloatGeometry, Job, Tile};
use crate::kernels::packed::{NR, SEGMENTS, for_rows};

/// Bytes ahead of each stream that are asked for.
const AHEAD: usize = 1024;

#[target_feature(enable = "avx512f")]
pub(super) fn run(job: &Job<'_, f32>, tile: &mut Tile<f32>) {
    // SAFETY: the pointer is to 16 weights.
    run_with(job, tile, |w| unsafe { _mm512_loadu_ps(w) });
}

/// The product for weights that `load` widens, given a pointer to 16 of them.
#[target_feature(enable = "avx512f")]
pub(crate) fn run_with<W>(job: &Job<'_, W>, tile: &mut Tile<f32>, load: impl Fn(*const W) -> __m512 + Copy) {
    job.check();
    for_rows!(job.rows, R => rows::<R, W, _>(job, tile, load))
}

/// As many panels at once as accumulators fit 24 registers.
#[target_feature(enable = "avx512f")]
fn rows<const R: usize, W, L: Fn(*const W) -> __m512 + Copy>(job: &Job<'_, W>, tile: &mut Tile<f32>, load: L) {
    let mut p = 0;
    while R <= 6 && p + 4 <= job.panels {
        block::<R, 4, W, L>(job, p, tile, load);
        p += 4;
    }
    while R <= 12 && p + 2 <= job.panels {
        block::<R, 2, W, L>(job, p, tile, load);
        p += 2;
    }
    while p < job.panels {
        block::<R, 1, W, L>(job, p, tile, load);
        p += 1;
    }
}

#[target_feature(enable = "avx512f")]
fn block<const R: usize, const P: usize, W, L: Fn(*const W) -> __m512 + Copy>(
    job: &Job<'_, W>,
    p: usize,
    tile: &mut Tile<f32>,
    load: L,
) {
    let FloatGeometry { seg, seg_stride, panel } = job.geo;
    let stride = job.stride;
    let weights = job.weights[(job.first + p) * panel..][..P * panel].as_ptr();
    let x = job.x[..R * stride].as_ptr();
    let mut acc = [[_mm512_setzero_ps(); P]; R];
    for k in 0..seg {
        for s in 0..SEGMENTS {
            let mut w = [_mm512_setzero_ps(); P];
            for (c, w) in w.iter_mut().enumerate() {
                // SAFETY: 16 weights of column k of segment s of panel c, all within the slice; a prefetch may point anywhere.
                unsafe {
                    let line = weights.add(c * panel + s * seg_stride + k * NR);
                    _mm_prefetch::<_MM_HINT_T0>(line.cast::<i8>().wrapping_add(AHEAD));
                    *w = load(line);
                }
            }
            for r in 0..R {
                // SAFETY: column s * seg + k of row r, below `stride`.
                let x = _mm512_set1_ps(unsafe { *x.add(r * stride + s * seg + k) });
                for c in 0..P {
                    acc[r][c] = _mm512_fmadd_ps(x, w[c], acc[r][c]);
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        for (c, acc) in acc.iter().enumerate() {
            let out = &mut tile[r][(p + c) * NR..][..NR];
            // SAFETY: 16 values at `out`.
            unsafe { _mm512_storeu_ps(out.as_mut_ptr(), *acc) };
        }
    }
}
