//! Whole vectors; what is left over goes through the reference.

use super::scalar;
use crate::kernels::wasm::{Madd, each, load4, tanh};
use std::arch::wasm32::*;

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, a: &[f32], b: &[f32], y: &mut [f32]) {
    let done = each(y, |v, at| distances(level, v, a, b, at), |v, at| distances(level, v, a, b, at));
    scalar::run(&a[done..], &b[done..], &mut y[done..]);
}

#[inline(always)]
fn distances<L: Madd, const N: usize>(level: L, mut v: [v128; N], a: &[f32], b: &[f32], at: usize) -> [v128; N] {
    for i in 0..N {
        v[i] = f32x4_abs(f32x4_sub(load4(a, at + 4 * i), load4(b, at + 4 * i)));
    }
    tanh(level, v)
}
