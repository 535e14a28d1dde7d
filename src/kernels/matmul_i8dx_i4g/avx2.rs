//! AVX2: `vpmaddubsw` of nibbles cannot saturate: the eight products of a lane's i16, each pair at most 2 * 15 * 127, add up to at
//! most 30,480. So a whole group is summed in i16 and widened once.

use std::arch::x86_64::*;

use super::{GROUP, GROUP_BYTES, Job, NR, Tile};

/// Bytes ahead that are asked for.
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

/// The product on 256 bits: `dot` adds products of 32 nibbles and bytes to an accumulator that starts at zero, and `widen` turns it
/// into 8 sums.
#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn run_with(
    job: &Job<'_>,
    tile: &mut Tile<f32>,
    dot: impl Fn(__m256i, __m256i, __m256i) -> __m256i + Copy,
    widen: impl Fn(__m256i) -> __m256i + Copy,
) {
    job.check();
    for p in 0..job.panels {
        for r in (0..job.rows).step_by(4) {
            match job.rows - r {
                1 => block::<1>(job, (r, p), tile, dot, widen),
                2 => block::<2>(job, (r, p), tile, dot, widen),
                3 => block::<3>(job, (r, p), tile, dot, widen),
                _ => block::<4>(job, (r, p), tile, dot, widen),
            }
        }
    }
}

/// Rows from `from.0`, panel `from.1` of the job.
#[target_feature(enable = "avx2,fma,f16c")]
fn block<const R: usize>(
    job: &Job<'_>,
    from: (usize, usize),
    tile: &mut Tile<f32>,
    dot: impl Fn(__m256i, __m256i, __m256i) -> __m256i + Copy,
    widen: impl Fn(__m256i) -> __m256i + Copy,
) {
    let (groups, panel, stride) = (job.geo.groups, job.geo.panel, job.stride);
    let start = (job.first + from.1) * panel;
    let weights = job.weights[start..][..panel].as_ptr();
    let scales = job.scales[(start + groups * GROUP_BYTES) / 2..][..groups * NR].as_ptr();
    let q = job.q[from.0 * stride..][..R * stride].as_ptr();
    let sums = &job.sums[from.0 * groups..][..R * groups];
    let low = _mm256_set1_epi8(15);
    let mut total = [[_mm256_setzero_ps(); 2]; R];
    for g in 0..groups {
        for h in 0..2 {
            let mut acc = [_mm256_setzero_si256(); R];
            for j in 0..GROUP / 8 {
                // SAFETY: half h of line j of group g, within the slice; a prefetch may point anywhere.
                let w = unsafe {
                    let line = weights.add(g * GROUP_BYTES + j * 64 + h * 32);
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
            // SAFETY: half of the 16 scales of group g.
            let scale = _mm256_cvtph_ps(unsafe { _mm_loadu_si128(scales.add(g * NR + h * 8).cast()) });
            for r in 0..R {
                let sum = _mm256_add_epi32(widen(acc[r]), _mm256_set1_epi32(-8 * sums[r * groups + g]));
                total[r][h] = _mm256_fmadd_ps(scale, _mm256_cvtepi32_ps(sum), total[r][h]);
            }
        }
    }
    for (r, total) in total.iter().enumerate() {
        let out = &mut tile[from.0 + r][from.1 * NR..][..NR];
        for (h, total) in total.iter().enumerate() {
            // SAFETY: 16 values at `out`.
            unsafe { _mm256_storeu_ps(out.as_mut_ptr().add(8 * h), *total) };
        }
    }
}
