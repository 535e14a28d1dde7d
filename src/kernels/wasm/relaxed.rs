//! Multiply-adds by `relaxed_madd` where it is fused.

use std::arch::wasm32::*;

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
