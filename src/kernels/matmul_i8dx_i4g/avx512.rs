//! Nibbles are unsigned, as `vpdpbusd` wants them; accumulators of a group start at -8 sum q, which
//! takes off their offset. Float sums stay in registers: four panels of up to 4 rows, two of up to
//! 6.

use std::arch::x86_64::*;

use super::{GROUP, Geometry, Job, NR, Tile};
use crate::kernels::packed::{PrefetchTarget, for_blocks, portions};

/// Bytes ahead of each panel that are asked for; at its end, those of the panel that this thread
/// reads next. These panels are asked for too, all the way, into the second-level cache: four
/// panels alone are too few streams for the memory.
const AHEAD: usize = 1024;

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    // All panels of a portion before the next: what was asked for ahead is then in the cache.
    for rows in portions(0..job.x.rows, 6) {
        for_blocks!(rows, job.panels.count, 16, R in [1 2 3 4 5 6], P in [4 2 1], |r, p| block::<R, P>(job, r, p, tile));
    }
}

/// Rows from `row`, panels from `p` of the job.
#[inline(never)]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni")]
fn block<const R: usize, const P: usize>(job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<f32>) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.x.stride);
    let start = (job.panels.first + p) * panel;
    let weights = job.weights[start..][..P * panel].as_ptr();
    let scales = job.scales[start / 2..][..P * panel / 2].as_ptr();
    let q = job.x.q[row * stride..][..R * stride].as_ptr();
    let sums = &job.x.sums[row * groups..][..R * groups];
    let low = _mm512_set1_epi8(15);
    // The next panels of this tile, or those of the next tile.
    let next = if p + P < job.panels.count {
        PrefetchTarget::new(job.weights, start + P * panel, panel)
    } else {
        job.panels.next
    };
    let own = PrefetchTarget::new(job.weights, start, panel);
    let mut total = [[_mm512_setzero_ps(); P]; R];
    for g in 0..groups {
        let at = Geometry::nibbles(g);
        let far = (at + AHEAD) as isize;
        let (far, line) = if at + AHEAD < panel { (own, far) } else { (next, far - panel as isize) };
        let start: [i32; R] = std::array::from_fn(|r| -8 * sums[r * groups + g]);
        for c in 0..P {
            let mut acc: [__m512i; R] = start.map(|s| _mm512_set1_epi32(s));
            for j in 0..GROUP / 8 {
                // SAFETY: line j of group g of panel c, within the slice; a prefetch may point
                // anywhere.
                let w = unsafe {
                    _mm_prefetch::<_MM_HINT_T0>(far.byte(c, line + j as isize * 64).cast());
                    _mm_prefetch::<_MM_HINT_T1>(next.byte(c, (at + j * 64) as isize).cast());
                    _mm512_loadu_si512(weights.add(c * panel + at + j * 64).cast())
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
            // SAFETY: the 16 scales of group g of panel c; a prefetch may point anywhere.
            let scale = _mm512_cvtph_ps(unsafe {
                _mm_prefetch::<_MM_HINT_T0>(far.byte(c, line + 256).cast());
                _mm_prefetch::<_MM_HINT_T1>(next.byte(c, at as isize + 256).cast());
                _mm256_loadu_si256(scales.add(c * panel / 2 + Geometry::scales(g)).cast())
            });
            for (total, acc) in total.iter_mut().zip(acc) {
                total[c] = _mm512_fmadd_ps(scale, _mm512_cvtepi32_ps(acc), total[c]);
            }
        }
    }
    for (r, total) in total.iter().enumerate() {
        for (c, total) in total.iter().enumerate() {
            let out = &mut tile[row + r][(p + c) * NR..][..NR];
            // SAFETY: 16 values at `out`.
            unsafe { _mm512_storeu_ps(out.as_mut_ptr(), *total) };
        }
    }
}
