//! AVX2: `vpmaddubsw` of nibbles cannot saturate: the eight products of a lane's i16, each pair at
//! most 2 * 15 * 127, add up to at most 30,480. So a whole group is summed in i16 and widened once.
//! Float sums stay in the tile, which leaves the registers to a group's accumulators.

use std::arch::x86_64::*;

use super::{GROUP, Geometry, Job, NR, Tile};
use crate::kernels::packed::{for_rows, portions};

/// Bytes ahead of each panel that are asked for.
const AHEAD: usize = 1024;

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    run_with(
        job,
        tile,
        |acc, nibbles, x| _mm256_add_epi16(acc, _mm256_maddubs_epi16(nibbles, x)),
        |acc| _mm256_madd_epi16(acc, _mm256_set1_epi16(1)),
    );
}

/// The product on 256 bits: `dot` adds products of 32 nibbles and bytes to an accumulator that
/// starts at zero, and `widen` turns it into 8 sums.
#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run_with(
    job: &Job<'_>,
    tile: &mut Tile<f32>,
    dot: impl Fn(__m256i, __m256i, __m256i) -> __m256i + Copy,
    widen: impl Fn(__m256i) -> __m256i + Copy,
) {
    job.check();
    for portion in portions(0..job.x.rows, 8) {
        let r = portion.start;
        for_rows!(portion.len(), R in [1 2 3 4 5 6 7 8] => rows::<R>(job, r, tile, dot, widen));
    }
}

/// Rows `row .. row + R` of the job.
#[target_feature(enable = "avx2,fma,f16c")]
fn rows<const R: usize>(
    job: &Job<'_>,
    row: usize,
    tile: &mut Tile<f32>,
    dot: impl Fn(__m256i, __m256i, __m256i) -> __m256i + Copy,
    widen: impl Fn(__m256i) -> __m256i + Copy,
) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.x.stride);
    let start = job.panels.first * panel;
    let weights = job.weights[start..][..job.panels.count * panel].as_ptr();
    let scales = job.scales[start / 2..][..job.panels.count * panel / 2].as_ptr();
    let q = job.x.q[row * stride..][..R * stride].as_ptr();
    let sums = &job.x.sums[row * groups..][..R * groups];
    let low = _mm256_set1_epi8(15);
    let tile = &mut tile[row..row + R];
    for row in &mut *tile {
        row[..job.panels.count * NR].fill(0.0);
    }
    for g in 0..groups {
        let offset: [i32; R] = std::array::from_fn(|r| -8 * sums[r * groups + g]);
        // Halves of panels: 8 lanes each.
        for half in 0..2 * job.panels.count {
            let (c, h) = (half / 2, half % 2);
            let mut acc = [_mm256_setzero_si256(); R];
            for j in 0..GROUP / 8 {
                // SAFETY: half h of line j of group g of panel c, within the slice; a prefetch may
                // point anywhere.
                let w = unsafe {
                    let line = weights.add(c * panel + Geometry::nibbles(g) + j * 64 + h * 32);
                    _mm_prefetch::<_MM_HINT_T0>(line.cast::<i8>().wrapping_add(AHEAD));
                    _mm256_loadu_si256(line.cast())
                };
                let (a, b) = (_mm256_and_si256(w, low), _mm256_and_si256(_mm256_srli_epi16::<4>(w), low));
                for (r, acc) in acc.iter_mut().enumerate() {
                    // SAFETY: 8 bytes at column 32 g + 8 j of row r, within R rows, `stride` apart.
                    let (x, y) = unsafe {
                        let x = q.add(r * stride + g * GROUP + j * 8).cast::<i32>();
                        (x.read_unaligned(), x.add(1).read_unaligned())
                    };
                    *acc = dot(dot(*acc, a, _mm256_set1_epi32(x)), b, _mm256_set1_epi32(y));
                }
            }
            // SAFETY: half of the 16 scales of group g of panel c.
            let scale = _mm256_cvtph_ps(unsafe {
                _mm_loadu_si128(scales.add(c * panel / 2 + Geometry::scales(g) + h * 8).cast())
            });
            for (r, row) in tile.iter_mut().enumerate() {
                let sum = _mm256_cvtepi32_ps(_mm256_add_epi32(widen(acc[r]), _mm256_set1_epi32(offset[r])));
                let total = row[half * 8..][..8].as_mut_ptr();
                // SAFETY: 8 values at `total`.
                unsafe { _mm256_storeu_ps(total, _mm256_fmadd_ps(scale, sum, _mm256_loadu_ps(total))) };
            }
        }
    }
}
