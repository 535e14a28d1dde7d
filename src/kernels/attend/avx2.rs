use std::arch::x86_64::*;

use super::scalar::{fold_chunk, soften};
use super::{CHUNK, Head, scalar};

/// Tokens whose scores are computed side by side.
const TOKENS: usize = 4;
/// Pairs of registers of results that stay in place while values go by.
const BLOCK: usize = 4;

/// 16 lanes.
type Pair = [__m256; 2];

/// # Safety
/// 16 values at `v`.
#[target_feature(enable = "avx2")]
unsafe fn load16(v: *const f32) -> Pair {
    // SAFETY: promised by the caller.
    unsafe { [_mm256_loadu_ps(v), _mm256_loadu_ps(v.add(8))] }
}

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn f16(head: &Head<'_, half::f16>, q: &[f32], out: &mut [f32]) {
    if !q.len().is_multiple_of(16) {
        return scalar::body(head, q, out, half::f16::to_f32);
    }
    body(head, q, out, |v| {
        // SAFETY: the pointer is to 16 values of 2 bytes.
        let (low, high) = unsafe { (_mm_loadu_si128(v.cast()), _mm_loadu_si128(v.add(8).cast())) };
        [_mm256_cvtph_ps(low), _mm256_cvtph_ps(high)]
    });
}

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn f32(head: &Head<'_, f32>, q: &[f32], out: &mut [f32]) {
    if !q.len().is_multiple_of(16) {
        return scalar::body(head, q, out, |v| v);
    }
    // SAFETY: the pointer is to 16 values.
    body(head, q, out, |v| unsafe { load16(v) });
}

/// The reference for whole registers; `load` widens the 16 values at a pointer.
#[target_feature(enable = "avx2,fma,f16c")]
fn body<T>(head: &Head<'_, T>, q: &[f32], out: &mut [f32], load: impl Fn(*const T) -> Pair + Copy) {
    head.check(q, out);
    let scale = 1.0 / (q.len() as f32).sqrt();
    out.fill(0.0);
    let (mut top, mut total) = (f32::NEG_INFINITY, 0.0f32);
    for start in (0..head.len).step_by(CHUNK) {
        let tokens = CHUNK.min(head.len - start);
        let mut p = [0.0f32; CHUNK];
        let mut t = 0;
        while t + TOKENS <= tokens {
            scores::<TOKENS, T>(head, q, start + t, &mut p[t..], load);
            t += TOKENS;
        }
        while t < tokens {
            scores::<1, T>(head, q, start + t, &mut p[t..], load);
            t += 1;
        }
        p.iter_mut().for_each(|p| *p *= scale);
        let (keep, new_top) = soften(&mut p, tokens, top);
        total = total.mul_add(keep, fold_chunk(&p));
        top = new_top;
        if start > 0 {
            out.iter_mut().for_each(|o| *o *= keep);
        }
        let (p, mut column) = (&p[..tokens], 0);
        while column < out.len() {
            // Few registers would wait for each other's sums.
            column += match (out.len() - column) / 16 {
                BLOCK.. => mix::<BLOCK, T>(head, start, p, column, out, load),
                2.. => mix::<2, T>(head, start, p, column, out, load),
                _ => mix::<1, T>(head, start, p, column, out, load),
            };
        }
    }
    if head.len > 0 {
        let inverse = 1.0 / total;
        out.iter_mut().for_each(|o| *o *= inverse);
    }
}

/// Dot products of `q` with the keys of tokens `t .. t + N`.
#[target_feature(enable = "avx2,fma,f16c")]
fn scores<const N: usize, T>(
    head: &Head<'_, T>,
    q: &[f32],
    t: usize,
    out: &mut [f32],
    load: impl Fn(*const T) -> Pair + Copy,
) {
    let keys: [&[T]; N] = std::array::from_fn(|i| &head.k[head.at(t + i)..][..q.len()]);
    let mut acc = [[_mm256_setzero_ps(); 2]; N];
    for j in (0..q.len()).step_by(16) {
        // SAFETY: 16 values from j, below the length, which is a multiple of 16.
        let x = unsafe { load16(q.as_ptr().add(j)) };
        for i in 0..N {
            // SAFETY: as above; keys are as long as q.
            let k = load(unsafe { keys[i].as_ptr().add(j) });
            for h in 0..2 {
                acc[i][h] = _mm256_fmadd_ps(x[h], k[h], acc[i][h]);
            }
        }
    }
    for (out, acc) in out.iter_mut().zip(acc) {
        *out = fold(acc);
    }
}

#[target_feature(enable = "avx2")]
fn fold(v: Pair) -> f32 {
    let v = _mm256_add_ps(v[0], v[1]);
    let v = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
    let v = _mm_add_ps(v, _mm_movehl_ps(v, v));
    _mm_cvtss_f32(_mm_add_ss(v, _mm_movehdup_ps(v)))
}

/// Adds the weighted values of a chunk to 16 N columns of `out`; returns their number.
#[target_feature(enable = "avx2,fma,f16c")]
fn mix<const N: usize, T>(
    head: &Head<'_, T>,
    start: usize,
    p: &[f32],
    column: usize,
    out: &mut [f32],
    load: impl Fn(*const T) -> Pair + Copy,
) -> usize {
    let out = out[column..][..16 * N].as_mut_ptr();
    // SAFETY: 16 N values at `out`.
    let mut acc: [Pair; N] = std::array::from_fn(|i| unsafe { load16(out.add(16 * i)) });
    for (t, p) in p.iter().enumerate() {
        let values = head.v[head.at(start + t) + column..][..16 * N].as_ptr();
        let p = _mm256_set1_ps(*p);
        for (i, acc) in acc.iter_mut().enumerate() {
            // SAFETY: 16 N values at `values`.
            let v = load(unsafe { values.add(16 * i) });
            for h in 0..2 {
                acc[h] = _mm256_fmadd_ps(p, v[h], acc[h]);
            }
        }
    }
    for (i, acc) in acc.iter().enumerate() {
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_ps(out.add(16 * i), acc[0]);
            _mm256_storeu_ps(out.add(16 * i + 8), acc[1]);
        }
    }
    16 * N
}
