//! Groups of 32 values; rows that are not whole groups go through the reference.

use std::arch::wasm32::*;

use super::GROUP;
use super::scalar::{self, MAGIC, TINY};
use crate::kernels::wasm::load;

#[inline(always)]
pub(super) fn run(x: &[f32], q: &mut [i8], sums: &mut [i32]) -> f32 {
    let n = x.len();
    if !n.is_multiple_of(GROUP) || q.len() != n || sums.len() * GROUP != n {
        return scalar::run(x, q, sums);
    }
    let top = largest(x);
    if !(TINY..f32::INFINITY).contains(&top) {
        return scalar::run(x, q, sums);
    }
    let inverse = f32x4_splat(127.0 / top);
    for ((x, q), sum) in x.as_chunks::<GROUP>().0.iter().zip(q.as_chunks_mut::<GROUP>().0).zip(sums) {
        let mut total = i16x8_splat(0);
        for half in 0..2 {
            let (a, b) = (integers(x, 16 * half, inverse), integers(x, 16 * half + 8, inverse));
            total = i16x8_add(total, i16x8_add(a, b));
            // SAFETY: 16 of 32 bytes.
            unsafe { v128_store(q.as_mut_ptr().add(16 * half).cast(), i8x16_narrow_i16x8(a, b)) };
        }
        *sum = sum_of(total);
    }
    top / 127.0
}

/// Eight values as integers, in -127..=127.
#[inline(always)]
fn integers(x: &[f32; GROUP], at: usize, inverse: v128) -> v128 {
    // The integer less the bits of MAGIC: exact, since both lie in one binade.
    let magic = f32x4_splat(MAGIC);
    let integer = |at| i32x4_sub(f32x4_add(f32x4_mul(load(x, at), inverse), magic), magic);
    i16x8_narrow_i32x4(integer(at), integer(at + 4))
}

/// The largest magnitude of whole groups.
#[inline(always)]
pub(in crate::kernels) fn largest(x: &[f32]) -> f32 {
    let magnitude = i32x4_splat(0x7fff_ffff);
    let mut top = [i32x4_splat(0); 4];
    for chunk in x.as_chunks::<16>().0 {
        for i in 0..4 {
            top[i] = i32x4_max(top[i], v128_and(load(chunk, 4 * i), magnitude));
        }
    }
    let top = i32x4_max(i32x4_max(top[0], top[1]), i32x4_max(top[2], top[3]));
    let top = i32x4_max(top, i64x2_shuffle::<1, 1>(top, top));
    f32::from_bits(i32x4_extract_lane::<0>(top).max(i32x4_extract_lane::<1>(top)) as u32)
}

/// The sum of eight integers of 16 bits.
#[inline(always)]
pub(in crate::kernels) fn sum_of(v: v128) -> i32 {
    let v = i32x4_extadd_pairwise_i16x8(v);
    let v = i32x4_add(v, i64x2_shuffle::<1, 1>(v, v));
    i32x4_extract_lane::<0>(v) + i32x4_extract_lane::<1>(v)
}
