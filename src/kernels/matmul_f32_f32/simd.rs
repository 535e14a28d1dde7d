//! The product on any level with [`F32x16`], for weights of any type.

use super::{FloatGeometry, Job, Tile};
use crate::kernels::f32x16::{F32x16, Stored};
use crate::kernels::packed::{NR, SEGMENTS, for_blocks};

/// Bytes ahead of each stream that are asked for.
const AHEAD: usize = 1024;

#[inline(always)]
pub(crate) fn run<L: F32x16, W: Stored>(level: L, job: &Job<'_, W>, tile: &mut Tile<f32>) {
    job.check();
    for_blocks!(
        0..job.rows, job.panels.count, L::ROOM,
        R in [1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16], P in [4 2 1],
        |r, p| block::<L, W, R, P>(level, job, (r, p), tile)
    );
}

/// Rows from `from.0`, panels from `from.1` of the job.
#[inline(always)]
fn block<L: F32x16, W: Stored, const R: usize, const P: usize>(
    level: L,
    job: &Job<'_, W>,
    from: (usize, usize),
    tile: &mut Tile<f32>,
) {
    let FloatGeometry { seg, seg_stride, panel } = job.geo;
    let stride = job.stride;
    let weights = job.weights[(job.panels.first + from.1) * panel..][..P * panel].as_ptr();
    let x = job.x[from.0 * stride..][..R * stride].as_ptr();
    let mut acc = [[level.zero(); P]; R];
    for k in 0..seg {
        for s in 0..SEGMENTS {
            let mut w = [level.zero(); P];
            for (c, w) in w.iter_mut().enumerate() {
                // SAFETY: 16 weights of column k of segment s of panel c, all within the slice.
                let line = unsafe { &*weights.add(c * panel + s * seg_stride + k * NR).cast::<[W; NR]>() };
                level.prefetch(line.as_ptr().cast::<u8>().wrapping_add(AHEAD));
                *w = W::load(level, line);
            }
            for r in 0..R {
                // SAFETY: column s * seg + k of row r, below `stride`.
                let x = level.splat(unsafe { *x.add(r * stride + s * seg + k) });
                for c in 0..P {
                    acc[r][c] = level.fma(acc[r][c], x, w[c]);
                }
            }
        }
    }
    for r in 0..R {
        let row = tile[from.0 + r].as_chunks_mut().0;
        for c in 0..P {
            level.store(acc[r][c], &mut row[from.1 + c]);
        }
    }
}
