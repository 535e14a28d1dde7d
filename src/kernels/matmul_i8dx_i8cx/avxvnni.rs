//! AVX-VNNI: `vpdpbusd` on 256 bits, with weights offset as in the AVX-512 variant.

use std::arch::x86_64::*;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;
use crate::kernels::quantize_rows::GROUP;

/// Parts of a panel's columns that are read side by side.
const STREAMS: usize = 4;
/// Bytes ahead of each stream that are asked for.
const AHEAD: usize = 512;

/// Accumulators fit 12 of 16 registers: 2 panels of up to 3 rows, 1 of up to 6.
#[target_feature(enable = "avx2,avxvnni")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, 6, R in [1 2 3 4 5 6], P in [2 1],
        |r, p| block::<R, P>(job, r, p, tile)
    );
}

/// Rows from `row`, panels from `p` of the job.
#[inline(never)]
#[target_feature(enable = "avx2,avxvnni")]
fn block<const R: usize, const P: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let padded = job.geo.padded;
    let weights = job.weights[(job.panels.first + p) * job.geo.panel..][..P * job.geo.panel].as_ptr();
    let q = job.x.q[row * job.x.stride..][..R * job.x.stride].as_ptr();
    let groups = padded / GROUP;
    let mut acc = [[[_mm256_setzero_si256(); 2]; P]; R];
    for (r, acc) in acc.iter_mut().enumerate() {
        let sum: i32 = job.x.sums[(row + r) * groups..][..groups].iter().sum();
        *acc = [[_mm256_set1_epi32(-128 * sum); 2]; P];
    }
    let part = padded / 4 / STREAMS;
    for k in 0..part {
        for s in 0..STREAMS {
            let k = k + s * part;
            for c in 0..P {
                // SAFETY: line k < padded / 4 of panel c, within the slice; a prefetch may point
                // anywhere.
                let w = unsafe {
                    let line = weights.add(c * job.geo.panel + k * 64);
                    _mm_prefetch::<_MM_HINT_T0>(line.cast::<i8>().wrapping_add(AHEAD));
                    [_mm256_loadu_si256(line.cast()), _mm256_loadu_si256(line.add(32).cast())]
                };
                for r in 0..R {
                    // SAFETY: 4 bytes at column 4k of row r, within R rows, `stride` apart.
                    let x =
                        _mm256_set1_epi32(unsafe { q.add(r * job.x.stride + 4 * k).cast::<i32>().read_unaligned() });
                    for h in 0..2 {
                        acc[r][c][h] = _mm256_dpbusd_avx_epi32(acc[r][c][h], w[h], x);
                    }
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        for (c, acc) in acc.iter().enumerate() {
            let out = &mut tile[row + r][(p + c) * NR..][..NR];
            // SAFETY: 16 values at `out`.
            unsafe {
                _mm256_storeu_si256(out.as_mut_ptr().cast(), acc[0]);
                _mm256_storeu_si256(out.as_mut_ptr().add(8).cast(), acc[1]);
            }
        }
    }
}
