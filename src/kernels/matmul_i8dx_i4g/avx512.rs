//! Nibbles are unsigned, as `vpdpbusd` wants them; accumulators of a group start at -8 sum q, which takes off their offset.

use std::arch::x86_64::*;

use super::{GROUP, GROUP_BYTES, Job, NR, Tile};

/// Bytes ahead of each stream that are asked for.
const AHEAD: usize = 1024;

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    let mut p = 0;
    while p < job.panels {
        let many = match (job.rows, job.panels - p) {
            (..=4, 4..) => 4,
            (_, 2..) => 2,
            _ => 1,
        };
        let mut r = 0;
        while r < job.rows {
            let left = (job.rows - r).min(8);
            match many {
                4 => rows::<4>(job, left.min(4), (r, p), tile),
                2 => rows::<2>(job, left, (r, p), tile),
                _ => rows::<1>(job, left, (r, p), tile),
            }
            r += left;
        }
        p += many;
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
fn rows<const P: usize>(job: &Job<'_>, rows: usize, from: (usize, usize), tile: &mut Tile<f32>) {
    match rows {
        1 => block::<1, P>(job, from, tile),
        2 => block::<2, P>(job, from, tile),
        3 => block::<3, P>(job, from, tile),
        4 => block::<4, P>(job, from, tile),
        5 => block::<5, P>(job, from, tile),
        6 => block::<6, P>(job, from, tile),
        7 => block::<7, P>(job, from, tile),
        _ => block::<8, P>(job, from, tile),
    }
}

/// Rows from `from.0`, panels from `from.1` of the job.
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
fn block<const R: usize, const P: usize>(job: &Job<'_>, from: (usize, usize), tile: &mut Tile<f32>) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.stride);
    let start = (job.first + from.1) * panel;
    let weights = job.weights[start..][..P * panel].as_ptr();
    let scales = job.scales[start / 2..][..P * panel / 2].as_ptr();
    let q = job.q[from.0 * stride..][..R * stride].as_ptr();
    let sums = &job.sums[from.0 * groups..][..R * groups];
    let low = _mm512_set1_epi8(15);
    let mut total = [[_mm512_setzero_ps(); P]; R];
    for g in 0..groups {
        for c in 0..P {
            let mut acc = [_mm512_setzero_si512(); R];
            for (r, acc) in acc.iter_mut().enumerate() {
                *acc = _mm512_set1_epi32(-8 * sums[r * groups + g]);
            }
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
            for r in 0..R {
                total[r][c] = _mm512_fmadd_ps(scale, _mm512_cvtepi32_ps(acc[r]), total[r][c]);
            }
        }
    }
    for (r, total) in total.iter().enumerate() {
        for (c, total) in total.iter().enumerate() {
            let out = &mut tile[from.0 + r][(from.1 + c) * NR..][..NR];
            // SAFETY: 16 values at `out`.
            unsafe { _mm512_storeu_ps(out.as_mut_ptr(), *total) };
        }
    }
}
