//! The reference: one row after the other, chunk by chunk; variants keep its order of sums, and run
//! it for heads that are no multiple of 16 wide.

use super::{CHUNK, Head, HeadOf, Row};
use crate::kernels::f32x16::Stored;
use crate::kernels::math::{LANES, exp, fold};

pub(super) fn run(head: HeadOf<'_>, rows: &mut [Row<'_>]) {
    match head {
        HeadOf::F16(head) => each(&head, rows),
        HeadOf::F32(head) => each(&head, rows),
    }
}

fn each<T: Stored>(head: &Head<'_, T>, rows: &mut [Row<'_>]) {
    head.check(rows);
    rows.iter_mut().for_each(|r| row(head, r));
}

#[inline(always)]
pub(super) fn row<T: Stored>(head: &Head<'_, T>, row: &mut Row<'_>) {
    let n = head.dim;
    let scale = 1.0 / (n as f32).sqrt();
    row.y.fill(0.0);
    let (mut top, mut total) = (f32::NEG_INFINITY, 0.0f32);
    for start in (0..row.len).step_by(CHUNK) {
        let tokens = CHUNK.min(row.len - start);
        let mut p = [0.0f32; CHUNK];
        for (t, p) in p[..tokens].iter_mut().enumerate() {
            *p = dot(row.q, &head.k[head.at(row, row.shift + start + t)..][..n]) * scale;
        }
        let exp_of = |p: &mut [f32; CHUNK], top| p.iter_mut().for_each(|p| *p = exp(*p - top));
        let (keep, new_top) = online_softmax(&mut p, tokens, top, exp_of);
        total = total.mul_add(keep, fold_chunk(&p));
        top = new_top;
        if start > 0 {
            row.y.iter_mut().for_each(|y| *y *= keep);
        }
        for (t, p) in p[..tokens].iter().enumerate() {
            let v = &head.v[head.at(row, row.shift + start + t)..][..n];
            for (y, v) in row.y.iter_mut().zip(v) {
                *y = p.mul_add(v.to_f32(), *y);
            }
        }
    }
    if row.len > 0 {
        let inverse = 1.0 / total;
        row.y.iter_mut().for_each(|y| *y *= inverse);
    }
}

#[inline(always)]
fn dot<T: Stored>(q: &[f32], k: &[T]) -> f32 {
    let mut acc = [0.0f32; LANES];
    let ((q, q_tail), (k, k_tail)) = (q.as_chunks::<LANES>(), k.as_chunks::<LANES>());
    for (q, k) in q.iter().zip(k) {
        for l in 0..LANES {
            acc[l] = q[l].mul_add(k[l].to_f32(), acc[l]);
        }
    }
    for (l, (q, k)) in q_tail.iter().zip(k_tail).enumerate() {
        acc[l] = q.mul_add(k.to_f32(), acc[l]);
    }
    fold(acc)
}

/// One step of the online softmax: the scores of `tokens` of a chunk to weights relative to the new
/// maximum, zeros behind them; `exp_of` puts e^(p - top) in the place of each. Returns what weights relative to the old maximum, `top`, are to be
/// multiplied by, and the new one.
#[inline(always)]
pub(super) fn online_softmax(
    p: &mut [f32; CHUNK],
    tokens: usize,
    top: f32,
    exp_of: impl Fn(&mut [f32; CHUNK], f32),
) -> (f32, f32) {
    let larger = |m: f32, s: f32| if s > m { s } else { m };
    p[tokens..].fill(f32::NEG_INFINITY);
    let mut tops = [top; LANES];
    for chunk in p.as_chunks::<LANES>().0 {
        for (m, &s) in tops.iter_mut().zip(chunk) {
            *m = larger(*m, s);
        }
    }
    let new_top = tops.into_iter().fold(top, larger);
    exp_of(p, new_top);
    p[tokens..].fill(0.0);
    (exp(top - new_top), new_top)
}

/// Sum of a chunk of weights: 16 lanes over the chunk, then folded.
#[inline(always)]
pub(super) fn fold_chunk(p: &[f32; CHUNK]) -> f32 {
    let mut acc = [0.0f32; LANES];
    for chunk in p.as_chunks::<LANES>().0 {
        for (a, p) in acc.iter_mut().zip(chunk) {
            *a += p;
        }
    }
    fold(acc)
}
