use std::arch::aarch64::*;

use super::scalar::{fold_chunk, soften};
use super::{CHUNK, Head, scalar};

/// Tokens whose scores are computed side by side.
const TOKENS: usize = 4;
/// Quads of registers of results that stay in place while values go by.
const BLOCK: usize = 4;

/// 16 lanes.
type Quad = [float32x4_t; 4];

/// # Safety
/// 16 values at `v`.
#[target_feature(enable = "neon")]
unsafe fn load16(v: *const f32) -> Quad {
    // SAFETY: promised by the caller.
    unsafe { [vld1q_f32(v), vld1q_f32(v.add(4)), vld1q_f32(v.add(8)), vld1q_f32(v.add(12))] }
}

#[target_feature(enable = "neon")]
pub(super) fn f16(head: &Head<'_, half::f16>, q: &[f32], out: &mut [f32]) {
    if !q.len().is_multiple_of(16) {
        return scalar::body(head, q, out, half::f16::to_f32);
    }
    body(head, q, out, |v| {
        [0, 4, 8, 12].map(|i| {
            // SAFETY: the pointer is to 16 values of 2 bytes.
            let half = unsafe { vld1_u16(v.cast::<u16>().add(i)) };
            vcvt_f32_f16(vreinterpret_f16_u16(half))
        })
    });
}

#[target_feature(enable = "neon")]
pub(super) fn f32(head: &Head<'_, f32>, q: &[f32], out: &mut [f32]) {
    if !q.len().is_multiple_of(16) {
        return scalar::body(head, q, out, |v| v);
    }
    // SAFETY: the pointer is to 16 values.
    body(head, q, out, |v| unsafe { load16(v) });
}

/// The reference for whole registers; `load` widens the 16 values at a pointer.
#[target_feature(enable = "neon")]
fn body<T>(head: &Head<'_, T>, q: &[f32], out: &mut [f32], load: impl Fn(*const T) -> Quad + Copy) {
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
#[target_feature(enable = "neon")]
fn scores<const N: usize, T>(
    head: &Head<'_, T>,
    q: &[f32],
    t: usize,
    out: &mut [f32],
    load: impl Fn(*const T) -> Quad + Copy,
) {
    let keys: [&[T]; N] = std::array::from_fn(|i| &head.k[head.at(t + i)..][..q.len()]);
    let mut acc = [[vdupq_n_f32(0.0); 4]; N];
    for j in (0..q.len()).step_by(16) {
        // SAFETY: 16 values from j, below the length, which is a multiple of 16.
        let x = unsafe { load16(q.as_ptr().add(j)) };
        for i in 0..N {
            // SAFETY: as above; keys are as long as q.
            let k = load(unsafe { keys[i].as_ptr().add(j) });
            for h in 0..4 {
                acc[i][h] = vfmaq_f32(acc[i][h], x[h], k[h]);
            }
        }
    }
    for (out, acc) in out.iter_mut().zip(acc) {
        *out = fold(acc);
    }
}

#[target_feature(enable = "neon")]
fn fold(v: Quad) -> f32 {
    let v = vaddq_f32(vaddq_f32(v[0], v[2]), vaddq_f32(v[1], v[3]));
    let v = vadd_f32(vget_low_f32(v), vget_high_f32(v));
    vget_lane_f32::<0>(v) + vget_lane_f32::<1>(v)
}

/// Adds the weighted values of a chunk to 16 N columns of `out`; returns their number.
#[target_feature(enable = "neon")]
fn mix<const N: usize, T>(
    head: &Head<'_, T>,
    start: usize,
    p: &[f32],
    column: usize,
    out: &mut [f32],
    load: impl Fn(*const T) -> Quad + Copy,
) -> usize {
    let out = out[column..][..16 * N].as_mut_ptr();
    // SAFETY: 16 N values at `out`.
    let mut acc: [Quad; N] = std::array::from_fn(|i| unsafe { load16(out.add(16 * i)) });
    for (t, p) in p.iter().enumerate() {
        let values = head.v[head.at(start + t) + column..][..16 * N].as_ptr();
        let p = vdupq_n_f32(*p);
        for (i, acc) in acc.iter_mut().enumerate() {
            // SAFETY: 16 N values at `values`.
            let v = load(unsafe { values.add(16 * i) });
            for h in 0..4 {
                acc[h] = vfmaq_f32(acc[h], p, v[h]);
            }
        }
    }
    for (i, acc) in acc.iter().enumerate() {
        // SAFETY: as above.
        unsafe { (0..4).for_each(|h| vst1q_f32(out.add(16 * i + 4 * h), acc[h])) };
    }
    16 * N
}
