use std::arch::x86_64::*;

use super::scalar::{fold_chunk, soften};
use super::{CHUNK, Head, scalar};

/// Tokens whose scores are computed side by side.
const TOKENS: usize = 4;
/// Tokens ahead of the one in work whose keys are asked for.
const AHEAD: usize = 8;
/// Registers of results that stay in place while values go by.
const BLOCK: usize = 8;

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn f16(head: &Head<'_, half::f16>, q: &[f32], out: &mut [f32]) {
    if !q.len().is_multiple_of(16) {
        return scalar::body(head, q, out, half::f16::to_f32);
    }
    // SAFETY: the pointer is to 16 values of 2 bytes.
    body(head, q, out, |v| _mm512_cvtph_ps(unsafe { _mm256_loadu_si256(v.cast()) }));
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn f32(head: &Head<'_, f32>, q: &[f32], out: &mut [f32]) {
    if !q.len().is_multiple_of(16) {
        return scalar::body(head, q, out, |v| v);
    }
    // SAFETY: the pointer is to 16 values.
    body(head, q, out, |v| unsafe { _mm512_loadu_ps(v) });
}

/// The reference for whole registers; `load` widens the 16 values at a pointer.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
fn body<T>(head: &Head<'_, T>, q: &[f32], out: &mut [f32], load: impl Fn(*const T) -> __m512 + Copy) {
    head.check(q, out);
    let scale = 1.0 / (q.len() as f32).sqrt();
    out.fill(0.0);
    let (mut top, mut total) = (f32::NEG_INFINITY, 0.0f32);
    for start in (0..head.len).step_by(CHUNK) {
        let tokens = CHUNK.min(head.len - start);
        let mut p = [0.0f32; CHUNK];
        let mut t = 0;
        while t + TOKENS <= tokens {
            for i in t..t + TOKENS {
                fetch(head, head.k, start + i + AHEAD, q.len());
                fetch(head, head.v, start + i, q.len());
            }
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
                4.. => mix::<4, T>(head, start, p, column, out, load),
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

/// Asks for this head's values of token `t` of `rows`, if there is one.
#[inline(always)]
fn fetch<T>(head: &Head<'_, T>, rows: &[T], t: usize, n: usize) {
    if t < head.len {
        let row = rows[head.at(t)..].as_ptr().cast::<i8>();
        for line in (0..n * size_of::<T>()).step_by(64) {
            // SAFETY: a prefetch may point anywhere.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(row.wrapping_add(line)) };
        }
    }
}

/// Dot products of `q` with the keys of tokens `t .. t + N`.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
fn scores<const N: usize, T>(
    head: &Head<'_, T>,
    q: &[f32],
    t: usize,
    out: &mut [f32],
    load: impl Fn(*const T) -> __m512 + Copy,
) {
    let keys: [&[T]; N] = std::array::from_fn(|i| &head.k[head.at(t + i)..][..q.len()]);
    let mut acc = [_mm512_setzero_ps(); N];
    for j in (0..q.len()).step_by(16) {
        // SAFETY: 16 values from j, below the length, which is a multiple of 16.
        let x = unsafe { _mm512_loadu_ps(q.as_ptr().add(j)) };
        for i in 0..N {
            // SAFETY: as above; keys are as long as q.
            acc[i] = _mm512_fmadd_ps(x, load(unsafe { keys[i].as_ptr().add(j) }), acc[i]);
        }
    }
    for (out, acc) in out.iter_mut().zip(acc) {
        *out = fold(acc);
    }
}

#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2")]
fn fold(v: __m512) -> f32 {
    let v = _mm256_add_ps(_mm512_castps512_ps256(v), _mm512_extractf32x8_ps::<1>(v));
    let v = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
    let v = _mm_add_ps(v, _mm_movehl_ps(v, v));
    _mm_cvtss_f32(_mm_add_ss(v, _mm_movehdup_ps(v)))
}

/// Adds the weighted values of a chunk to 16 N columns of `out`; returns their number.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
fn mix<const N: usize, T>(
    head: &Head<'_, T>,
    start: usize,
    p: &[f32],
    column: usize,
    out: &mut [f32],
    load: impl Fn(*const T) -> __m512 + Copy,
) -> usize {
    let out = out[column..][..16 * N].as_mut_ptr();
    // SAFETY: 16 N values at `out`.
    let mut acc: [__m512; N] = std::array::from_fn(|i| unsafe { _mm512_loadu_ps(out.add(16 * i)) });
    for (t, p) in p.iter().enumerate() {
        let values = head.v[head.at(start + t) + column..][..16 * N].as_ptr();
        let p = _mm512_set1_ps(*p);
        for (i, acc) in acc.iter_mut().enumerate() {
            // SAFETY: 16 N values at `values`.
            *acc = _mm512_fmadd_ps(p, load(unsafe { values.add(16 * i) }), *acc);
        }
    }
    for (i, acc) in acc.iter().enumerate() {
        // SAFETY: as above.
        unsafe { _mm512_storeu_ps(out.add(16 * i), *acc) };
    }
    16 * N
}
