//! `vpdpbusd` multiplies unsigned by signed bytes and adds four products to an i32 without
//! saturation. Weights are the unsigned side, offset by 128: sum q (w + 128) = sum q w + 128 sum q,
//! so accumulators start at -128 sum q.

use std::arch::x86_64::*;

use super::{Job, NR, Tile};
use crate::kernels::packed::{PrefetchTarget, for_blocks};
use crate::kernels::quantize_rows::GROUP;

/// Parts of a panel's columns that are read side by side.
const STREAMS: usize = 2;
/// Lines ahead of each stream that are asked for; at its end, those of the streams that this thread
/// reads next.
const AHEAD: usize = 16;

/// As many panels at once as accumulators fit 24 registers.
macro_rules! walk {
    ($job:ident, $rows:expr, $n:tt, $fetch:ident, $tile:ident) => {
        for_blocks!($rows, $job.panels.count, 24, R in $n, P in [4 2 1],
            |r, p| block::<R, P, $fetch>($job, r, p, $tile))
    };
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    // Few rows wait for memory all the time, and looking further ahead than a few lines would cost
    // them slots. More rows leave it idle unless the next tile is asked for evenly while they
    // compute: by one portion, or by half in each of two where two panels have no accumulators for
    // all rows; the second then finds the weights in the cache.
    let rows = job.x.rows;
    match rows {
        ..8 => walk!(job, 0..rows, [1 2 3 4 5 6 7], NOTHING, tile),
        8..=12 => walk!(job, 0..rows, [8 9 10 11 12], ALL, tile),
        _ => {
            let half = rows.div_ceil(2);
            walk!(job, 0..half, [7 8], FIRST, tile);
            walk!(job, half..rows, [6 7 8], SECOND, tile);
        }
    }
}

/// Streams, a bit each, whose lines in the next tile are asked for.
const NOTHING: u8 = 0b00;
const FIRST: u8 = 0b01;
const SECOND: u8 = 0b10;
const ALL: u8 = FIRST | SECOND;

#[inline(never)]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
fn block<const R: usize, const P: usize, const FETCH: u8>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let (padded, panel) = (job.geo.padded, job.geo.panel);
    let start = (job.panels.first + p) * panel;
    let weights = job.weights[start..][..P * panel].as_ptr();
    let q = job.x.q[row * job.x.stride..][..R * job.x.stride].as_ptr();
    let groups = padded / GROUP;
    let mut acc = [[_mm512_setzero_si512(); P]; R];
    for (r, acc) in acc.iter_mut().enumerate() {
        let sum: i32 = job.x.sums[(row + r) * groups..][..groups].iter().sum();
        *acc = [_mm512_set1_epi32(-128 * sum); P];
    }
    let quads = padded / 4;
    let part = quads / STREAMS;
    // The next panels of this tile, or those of the next tile.
    let own = PrefetchTarget::new(job.weights, start, panel);
    let next = if p + P < job.panels.count {
        PrefetchTarget::new(job.weights, start + P * panel, panel)
    } else {
        job.panels.next
    };
    for k in 0..part {
        let (far, line) = if k + AHEAD < part { (own, k + AHEAD) } else { (next, k + AHEAD - part) };
        for s in 0..STREAMS {
            let (k, line) = (k + s * part, 64 * (line + s * part) as isize);
            for c in 0..P {
                // SAFETY: k < quads, so the line lies in panel c of the slice; a prefetch may point
                // anywhere.
                let w = unsafe {
                    _mm_prefetch::<_MM_HINT_T0>(far.byte(c, line).cast());
                    if FETCH >> s & 1 == 1 {
                        _mm_prefetch::<_MM_HINT_T1>(job.panels.next.byte(p + c, 64 * k as isize).cast());
                    }
                    _mm512_loadu_si512(weights.add(c * panel + k * 64).cast())
                };
                for r in 0..R {
                    // SAFETY: 4 bytes at column 4k of row r, within R rows, `stride` apart.
                    let x = unsafe { q.add(r * job.x.stride + 4 * k).cast::<i32>().read_unaligned() };
                    acc[r][c] = _mm512_dpbusd_epi32(acc[r][c], w, _mm512_set1_epi32(x));
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        for (c, acc) in acc.iter().enumerate() {
            let out = &mut tile[row + r][(p + c) * NR..][..NR];
            // SAFETY: 16 values at `out`.
            unsafe { _mm512_storeu_si512(out.as_mut_ptr().cast(), *acc) };
        }
    }
}
