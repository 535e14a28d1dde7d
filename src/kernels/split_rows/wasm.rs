//! Groups of 32 values; rows that are not whole groups go through the reference.

use std::arch::wasm32::*;

use super::BASE;
use super::scalar::{self, RANGE};
use crate::kernels::quantize_rows::wasm::{largest, sum_of};
use crate::kernels::quantize_rows::{GROUP, MAGIC, scalable};
use crate::kernels::wasm::load;

#[inline(always)]
pub(super) fn run(x: &[f32], [high, low]: [&mut [i8]; 2], [high_sums, low_sums]: [&mut [i32]; 2]) -> f32 {
    let n = x.len();
    let whole = n.is_multiple_of(GROUP) && high.len() == n && low.len() == n;
    let top = match scalable(largest(if whole { x } else { &[] })) {
        Ok(top) if high_sums.len() * GROUP == n && low_sums.len() * GROUP == n => top,
        _ => return scalar::run(x, [high, low], [high_sums, low_sums]),
    };
    let inverse = f32x4_splat(RANGE / top);
    for (g, x) in x.as_chunks::<GROUP>().0.iter().enumerate() {
        let mut totals = [i16x8_splat(0); 2];
        for half in 0..2 {
            let (a, b) = (integers(x, 16 * half, inverse), integers(x, 16 * half + 8, inverse));
            for (i, q) in [&mut *high, &mut *low].into_iter().enumerate() {
                totals[i] = i16x8_add(totals[i], i16x8_add(a[i], b[i]));
                let q = &mut q[g * GROUP + 16 * half..][..16];
                // SAFETY: 16 bytes.
                unsafe { v128_store(q.as_mut_ptr().cast(), i8x16_narrow_i16x8(a[i], b[i])) };
            }
        }
        (high_sums[g], low_sums[g]) = (sum_of(totals[0]), sum_of(totals[1]));
    }
    top / RANGE
}

/// Eight values as integers of the high and of the low row, computed as the reference does.
#[inline(always)]
fn integers(x: &[f32; GROUP], at: usize, inverse: v128) -> [v128; 2] {
    let magic = f32x4_splat(MAGIC);
    let four = |at| {
        let q = f32x4_sub(f32x4_add(f32x4_mul(load(x, at), inverse), magic), magic);
        let high = f32x4_add(f32x4_mul(q, f32x4_splat(1.0 / BASE)), magic);
        let rest = f32x4_sub(q, f32x4_mul(f32x4_sub(high, magic), f32x4_splat(BASE)));
        [i32x4_sub(high, magic), i32x4_sub(f32x4_add(rest, magic), magic)]
    };
    let ([a, b], [c, d]) = (four(at), four(at + 4));
    [i16x8_narrow_i32x4(a, c), i16x8_narrow_i32x4(b, d)]
}
