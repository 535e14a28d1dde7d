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
