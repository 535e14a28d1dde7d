//! The functions of [`math`](crate::kernels::math) on N vectors of four: the same operations in the
//! same order.

use std::arch::wasm32::*;

use super::{Madd, load4, store4};
use crate::kernels::math::{EXP_COEFFICIENTS, EXP_HIGH, EXP_LOW, GELU_A, GELU_B, LN2_HI, LN2_LO, MAGIC};

/// Puts `f` of each whole vector of `values` in its place, four vectors at a time; returns how many
/// values that were.
#[inline(always)]
pub(in crate::kernels) fn each(
    values: &mut [f32],
    four: impl Fn([v128; 4], usize) -> [v128; 4],
    one: impl Fn([v128; 1], usize) -> [v128; 1],
) -> usize {
    let (n, whole) = (values.len(), values.len() / 4 * 4);
    for at in (0..n / 16).map(|i| 16 * i) {
        let mut v = [f32x4_splat(0.0); 4];
        for i in 0..4 {
            v[i] = load4(values, at + 4 * i);
        }
        let v = four(v, at);
        for i in 0..4 {
            store4(values, at + 4 * i, v[i]);
        }
    }
    for at in (n / 16 * 16..whole).step_by(4) {
        let [v] = one([load4(values, at)], at);
        store4(values, at, v);
    }
    whole
}

/// e^x.
#[inline(always)]
pub(in crate::kernels) fn exp<L: Madd, const N: usize>(level: L, x: [v128; N]) -> [v128; N] {
    let (log2e, magic) = ([level.splat(std::f32::consts::LOG2_E); N], [level.splat(MAGIC); N]);
    let mut wide = magic;
    for i in 0..N {
        // As comparisons: a NaN stays.
        let x = f32x4_pmin(f32x4_pmax(x[i], f32x4_splat(EXP_LOW)), f32x4_splat(EXP_HIGH));
        wide[i] = level.wide(x);
    }
    let t = level.madd(wide, log2e, magic);
    let mut n = t;
    for i in 0..N {
        n[i] = level.difference(t[i], magic[i]);
    }
    let r = level.madd(n, [level.splat(-LN2_HI); N], wide);
    let r = level.madd(n, [level.splat(-LN2_LO); N], r);
    let mut p = [level.splat(EXP_COEFFICIENTS[0]); N];
    for c in &EXP_COEFFICIENTS[1..] {
        p = level.madd(r, p, [level.splat(*c); N]);
    }
    let mut out = x;
    for i in 0..N {
        let power = i32x4_add(i32x4_shl(level.narrow(t[i]), 23), i32x4_splat(0x3f80_0000));
        out[i] = f32x4_mul(level.narrow(p[i]), power);
    }
    out
}

/// x / (1 + e^-x).
#[inline(always)]
pub(in crate::kernels) fn silu<L: Madd, const N: usize>(level: L, x: [v128; N]) -> [v128; N] {
    let mut negative = x;
    for i in 0..N {
        negative[i] = f32x4_neg(x[i]);
    }
    over(x, exp(level, negative))
}

/// GELU in its tanh form.
#[inline(always)]
pub(in crate::kernels) fn gelu<L: Madd, const N: usize>(level: L, x: [v128; N]) -> [v128; N] {
    let mut square = [level.splat(0.0); N];
    for i in 0..N {
        square[i] = level.wide(f32x4_mul(x[i], x[i]));
    }
    let inner = level.madd(square, [level.splat(GELU_B); N], [level.splat(GELU_A); N]);
    let mut argument = x;
    for i in 0..N {
        argument[i] = f32x4_mul(x[i], level.narrow(inner[i]));
    }
    over(x, exp(level, argument))
}

/// x / (1 + e)
#[inline(always)]
fn over<const N: usize>(x: [v128; N], mut e: [v128; N]) -> [v128; N] {
    for i in 0..N {
        e[i] = f32x4_div(x[i], f32x4_add(f32x4_splat(1.0), e[i]));
    }
    e
}

/// 1 / (1 + e^-x).
#[inline(always)]
pub(in crate::kernels) fn sigmoid<L: Madd, const N: usize>(level: L, x: [v128; N]) -> [v128; N] {
    let mut negative = x;
    for i in 0..N {
        negative[i] = f32x4_neg(x[i]);
    }
    over([f32x4_splat(1.0); N], exp(level, negative))
}

/// tanh x as 2 / (1 + e^(-2x)) - 1.
#[inline(always)]
pub(in crate::kernels) fn tanh<L: Madd, const N: usize>(level: L, x: [v128; N]) -> [v128; N] {
    let mut argument = x;
    for i in 0..N {
        argument[i] = f32x4_mul(f32x4_splat(-2.0), x[i]);
    }
    let mut y = over([f32x4_splat(2.0); N], exp(level, argument));
    for i in 0..N {
        y[i] = f32x4_sub(y[i], f32x4_splat(1.0));
    }
    y
}
