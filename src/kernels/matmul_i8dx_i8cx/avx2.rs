//! Exact int8 products without VNNI. `vpmaddubsw` would saturate, so bytes are widened: with
//! columns of a lane in the order 0, 2, 1, 3, the even bytes, sign-extended in place, are the i16
//! pair (0, 1) and the odd ones the pair (2, 3), which `vpmaddwd` multiplies with the same pairs of
//! the widened activations and adds to an i32 without overflow.

use std::arch::x86_64::*;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;

/// Bytes ahead of each stream that are asked for.
const AHEAD: usize = 512;
/// Parts of a panel's columns that are read side by side.
const STREAMS: usize = 4;

#[target_feature(enable = "avx2")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    assert!(job.x.wide.len() >= job.x.rows * job.x.stride, "widened rows");
    for_blocks!(0..job.x.rows, job.panels.count, 5, R in [1 2 3 4 5], P in [1], |r, p| block::<R>(job, r, p, tile));
}

/// Rows `row .. row + R` of panel `p` of the job.
#[inline(never)]
#[target_feature(enable = "avx2")]
fn block<const R: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let padded = job.geo.padded;
    let weights = job.weights[(job.panels.first + p) * job.geo.panel..][..NR * padded].as_ptr();
    let x = job.x.wide[row * job.x.stride..][..R * job.x.stride].as_ptr();
    let mut acc = [[_mm256_setzero_si256(); 2]; R];
    let part = padded / 4 / STREAMS;
    for k in 0..part {
        for s in 0..STREAMS {
            let k = k + s * part;
            for h in 0..2 {
                // SAFETY: half h of line k < padded / 4 of the panel; a prefetch may point
                // anywhere.
                let w = unsafe {
                    let line = weights.add(k * 64 + h * 32);
                    _mm_prefetch::<_MM_HINT_T0>(line.cast::<i8>().wrapping_add(AHEAD));
                    _mm256_loadu_si256(line.cast())
                };
                let even = _mm256_srai_epi16::<8>(_mm256_slli_epi16::<8>(w));
                let odd = _mm256_srai_epi16::<8>(w);
                for r in 0..R {
                    // SAFETY: columns 4k .. 4k + 4 of row r, within R rows, `stride` apart.
                    let (a, b) = unsafe {
                        let x = x.add(r * job.x.stride + 4 * k).cast::<i32>();
                        (x.read_unaligned(), x.add(1).read_unaligned())
                    };
                    let sum = _mm256_add_epi32(
                        _mm256_madd_epi16(even, _mm256_set1_epi32(a)),
                        _mm256_madd_epi16(odd, _mm256_set1_epi32(b)),
                    );
                    acc[r][h] = _mm256_add_epi32(acc[r][h], sum);
                }
            }
        }
    }
    for (r, acc) in acc.iter().enumerate() {
        let out = &mut tile[row + r][p * NR..][..NR];
        for (h, acc) in acc.iter().enumerate() {
            // SAFETY: 16 values at `out`.
            unsafe { _mm256_storeu_si256(out.as_mut_ptr().add(8 * h).cast(), *acc) };
        }
    }
}
