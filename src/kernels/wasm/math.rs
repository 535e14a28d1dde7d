//! The functions of [`math`](crate::kernels::math) on four lanes: the same operations in the same
//! order.

use std::arch::wasm32::*;

use super::Madd;
use crate::kernels::math::{EXP_COEFFICIENTS, EXP_HIGH, EXP_LOW, GELU_A, GELU_B, LN2_HI, LN2_LO, MAGIC};

/// e^x.
#[inline(always)]
pub(in crate::kernels) fn exp<L: Madd>(level: L, x: v128) -> v128 {
    // As comparisons: a NaN stays.
    let x = f32x4_pmin(f32x4_pmax(x, f32x4_splat(EXP_LOW)), f32x4_splat(EXP_HIGH));
    let (x, magic) = (level.wide(x), level.splat(MAGIC));
    let t = level.madd(x, level.splat(std::f32::consts::LOG2_E), magic);
    let n = level.difference(t, magic);
    let r = level.madd(n, level.splat(-LN2_LO), level.madd(n, level.splat(-LN2_HI), x));
    let mut p = level.splat(EXP_COEFFICIENTS[0]);
    for c in &EXP_COEFFICIENTS[1..] {
        p = level.madd(r, p, level.splat(*c));
    }
    let power = i32x4_add(i32x4_shl(level.narrow(t), 23), i32x4_splat(0x3f80_0000));
    f32x4_mul(level.narrow(p), power)
}

/// x / (1 + e^-x).
#[inline(always)]
pub(in crate::kernels) fn silu<L: Madd>(level: L, x: v128) -> v128 {
    f32x4_div(x, f32x4_add(f32x4_splat(1.0), exp(level, f32x4_neg(x))))
}

/// GELU in its tanh form.
#[inline(always)]
pub(in crate::kernels) fn gelu<L: Madd>(level: L, x: v128) -> v128 {
    let inner = level.fma(f32x4_mul(x, x), f32x4_splat(GELU_B), f32x4_splat(GELU_A));
    let e = exp(level, f32x4_mul(x, inner));
    f32x4_div(x, f32x4_add(f32x4_splat(1.0), e))
}
