//! Half a panel at a time: its eight sums of several rows, and its weights, stay in registers.

use std::arch::wasm32::*;

use super::{FloatGeometry, Job, Tile};
use crate::kernels::packed::{NR, SEGMENTS, for_rows, portions};
use crate::kernels::wasm::{Madd, load};

#[inline(always)]
pub(crate) fn run<L: Madd>(level: L, job: &Job<'_, f32>, tile: &mut Tile<f32>) {
    job.check();
    for half in 0..2 * job.panels.count {
        for rows in portions(0..job.rows, L::ROWS) {
            let from = (rows.start, half);
            for_rows!(rows.len(), R in [1 2 3 4] => if R <= L::ROWS { block::<L, R>(level, job, from, tile) });
        }
    }
}

/// Rows from `from.0` of half panel `from.1` of the job.
#[inline(never)]
fn block<L: Madd, const R: usize>(level: L, job: &Job<'_, f32>, from: (usize, usize), tile: &mut Tile<f32>) {
    let FloatGeometry { seg, seg_stride, panel } = job.geo;
    let (stride, at) = (job.stride, from.1 % 2 * (NR / 2));
    let weights = job.weights[(job.panels.first + from.1 / 2) * panel..][..panel].as_ptr();
    let x = job.x[from.0 * stride..][..R * stride].as_ptr();
    let mut acc = [[level.splat(0.0); 2]; R];
    for k in 0..seg {
        for s in 0..SEGMENTS {
            // SAFETY: 16 weights of column k of segment s of the panel.
            let line = unsafe { &*weights.add(s * seg_stride + k * NR).cast::<[f32; NR]>() };
            let w = [level.wide(load(line, at)), level.wide(load(line, at + 4))];
            for r in 0..R {
                // SAFETY: column s * seg + k of row r, below `stride`.
                let x = level.wide(unsafe { v128_load32_splat(x.add(r * stride + s * seg + k).cast()) });
                acc[r] = level.madd([x; 2], w, acc[r]);
            }
        }
    }
    for r in 0..R {
        let out = &mut tile[from.0 + r][from.1 * NR / 2..][..NR / 2];
        for i in 0..2 {
            // SAFETY: 8 values at `out`.
            unsafe { v128_store(out.as_mut_ptr().add(4 * i).cast(), level.narrow(acc[r][i])) };
        }
    }
}
