//! Nibbles are unsigned, as `vpdpbusd` wants them; accumulators of a group start at -8 sum q, which takes off their offset.
//!
//! Float sums stay in the tile, which leaves the registers to a group's accumulators.

use std::arch::x86_64::*;

use super::{GROUP, GROUP_BYTES, Job, NR, Tile};

/// Bytes ahead of each panel that are asked for.
const AHEAD: usize = 1024;

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    // Even portions of at most 5 rows: with more, the compiler runs out of registers.
    let portion = job.rows.div_ceil(job.rows.div_ceil(5));
    for r in (0..job.rows).step_by(portion) {
        match portion.min(job.rows - r) {
            1 => rows::<1>(job, r, tile),
            2 => rows::<2>(job, r, tile),
            3 => rows::<3>(job, r, tile),
            4 => rows::<4>(job, r, tile),
            _ => rows::<5>(job, r, tile),
        }
    }
}

/// Rows `row .. row + R` of the job.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
fn rows<const R: usize>(job: &Job<'_>, row: usize, tile: &mut Tile<f32>) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.stride);
    let start = job.first * panel;
    let weights = job.weights[start..][..job.panels * panel].as_ptr();
    let scales = job.scales[start / 2..][..job.panels * panel / 2].as_ptr();
    let q = job.q[row * stride..][..R * stride].as_ptr();
    let sums = &job.sums[row * groups..][..R * groups];
    let low = _mm512_set1_epi8(15);
    let tile = &mut tile[row..row + R];
    for row in &mut *tile {
        row[..job.panels * NR].fill(0.0);
    }
    for g in 0..groups {
        let start: [i32; R] = std::array::from_fn(|r| -8 * sums[r * groups + g]);
        for c in 0..job.panels {
            let mut acc: [__m512i; R] = start.map(|s| _mm512_set1_epi32(s));
            for j in 0..GROUP / 8 {
                // SAFETY: line j of group g of panel c, within the slice; a prefetch may point anywhere.
                let w = unsafe {
                    let line = weights.add(c * panel + g * GROUP_BYTES + j * 64);
                    _mm_prefetch::<_MM_HINT_T0>(line.cast::<i8>().wrapping_add(AHEAD));
                    _mm512_loadu_si512(line.cast())
                };
                let (a, b) = (_mm512_and_si512(w, low), _mm512_and_si512(_mm512_srli_epi16::<4>(w), low));
                for (r, acc) in acc.iter_mut().enumerate() {
                    // SAFETY: 8 bytes at column 32 g + 8 j of row r, within R rows, `stride` apart.
                    let (x, y) = unsafe {
                        let x = q.add(r * stride + g * GROUP + j * 8).cast::<i32>();
                        (x.read_unaligned(), x.add(1).read_unaligned())
                    };
                    *acc = _mm512_dpbusd_epi32(*acc, a, _mm512_set1_epi32(x));
                    *acc = _mm512_dpbusd_epi32(*acc, b, _mm512_set1_epi32(y));
                }
            }
            // SAFETY: 16 scales of group g behind the nibbles of panel c.
            let scale = _mm512_cvtph_ps(unsafe {
                _mm256_loadu_si256(scales.add((c * panel + groups * GROUP_BYTES) / 2 + g * NR).cast())
            });
            for (acc, row) in acc.into_iter().zip(&mut *tile) {
                let total = row[c * NR..][..NR].as_mut_ptr();
                // SAFETY: 16 values at `total`.
                unsafe {
                    let sum = _mm512_fmadd_ps(scale, _mm512_cvtepi32_ps(acc), _mm512_loadu_ps(total));
                    _mm512_storeu_ps(total, sum);
                }
            }
        }
    }
}
