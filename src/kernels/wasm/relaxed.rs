//! Multiply-adds by `relaxed_madd` where it is fused.

use std::arch::wasm32::*;
use std::hint::black_box;

use super::Madd;
use crate::kernels::level::token::Relaxed;

impl Madd for Relaxed {
    type Wide = v128;

    const ROWS: usize = 4;

    #[inline(always)]
    fn wide(self, v: v128) -> v128 {
        v
    }

    #[inline(always)]
    fn narrow(self, v: v128) -> v128 {
        v
    }

    #[inline(always)]
    fn madd<const N: usize>(self, a: [v128; N], b: [v128; N], mut c: [v128; N]) -> [v128; N] {
        for i in 0..N {
            c[i] = f32x4_relaxed_madd(a[i], b[i], c[i]);
        }
        c
    }

    #[inline(always)]
    fn difference(self, a: v128, b: v128) -> v128 {
        f32x4_sub(a, b)
    }
}

/// Whether `relaxed_madd` rounds once here. An engine computes it in one way as long as it runs.
pub(in crate::kernels) fn is_fused() -> bool {
    // (1 + e)(1 - e) - 1 = -e^2, which is lost if the product is rounded to 1 first.
    let e = f32x4_splat(black_box(f32::EPSILON));
    let one = f32x4_splat(black_box(1.0));
    let found = f32x4_relaxed_madd(f32x4_add(one, e), f32x4_sub(one, e), f32x4_neg(one));
    i32x4_all_true(f32x4_eq(found, f32x4_neg(f32x4_mul(e, e))))
}
<<<<<<< HEAD
=======

/// What `relaxed_dot_i8x16_i7x16_add` makes of a second operand beyond seven bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::kernels) enum Dot {
    /// Signed bytes, exact sums.
    Signed,
    /// Unsigned bytes, exact sums.
    Unsigned,
    /// Anything else: what lies within seven bits is exact everywhere.
    Seven,
}

/// What it does here.
pub(in crate::kernels) fn dot() -> Dot {
    // The largest sums of pairs of either kind, which 16 bits do not hold, and small ones.
    let a = [-127i8, -127, 127, 127, -127, 127, 3, -5].map(black_box);
    let b = [0xffu8, 0xff, 0xff, 0xff, 0x80, 0x80, 0x80, 0x81].map(black_box);
    let mut kinds = [true; 2];
    for at in 0..8 {
        let (mut first, mut second, mut sums) = ([0i8; 16], [0u8; 16], [[0i32; 4]; 2]);
        for i in 0..16 {
            (first[i], second[i]) = (a[(i + at) % 8], b[(i * (1 + at % 3)) % 8]);
            sums[0][i / 4] += i32::from(first[i]) * i32::from(second[i] as i8);
            sums[1][i / 4] += i32::from(first[i]) * i32::from(second[i]);
        }
        let found =
            i32x4_relaxed_dot_i8x16_i7x16_add(super::load(&first, 0), super::load(&second, 0), i32x4_splat(at as i32));
        for (kind, sums) in kinds.iter_mut().zip(&sums) {
            let expected = i32x4_add(super::load(sums, 0), i32x4_splat(at as i32));
            *kind &= i32x4_all_true(i32x4_eq(found, expected));
        }
    }
    match kinds {
        [true, _] => Dot::Signed,
        [_, true] => Dot::Unsigned,
        _ => Dot::Seven,
    }
}
>>>>>>> page
