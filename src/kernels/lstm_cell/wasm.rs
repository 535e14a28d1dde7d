//! Whole vectors; what is left over goes through the reference.

use super::scalar;
use crate::kernels::wasm::{Madd, each, load4, sigmoid, tanh};
use std::arch::wasm32::*;

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, gates: &[f32], c: &mut [f32], h: &mut [f32]) {
    let n = c.len();
    let [i, f, g, o] = [0, 1, 2, 3].map(|gate| &gates[gate * n..(gate + 1) * n]);
    let h = &mut h[..n];
    let done = each(c, |v, at| cells(level, v, [i, f, g], at), |v, at| cells(level, v, [i, f, g], at));
    each(h, |_, at| outputs(level, o, c, at), |_, at| outputs(level, o, c, at));
    let mut rest = [0.0; 12];
    let left = n - done;
    for (gate, from) in [i, f, g, o].into_iter().enumerate() {
        rest[gate * left..(gate + 1) * left].copy_from_slice(&from[done..]);
    }
    scalar::run(&rest[..4 * left], &mut c[done..], &mut h[done..]);
}

/// sigmoid(f) c + sigmoid(i) tanh(g)
#[inline(always)]
fn cells<L: Madd, const N: usize>(level: L, c: [v128; N], gates: [&[f32]; 3], at: usize) -> [v128; N] {
    let [i, f, g] = gates.map(|gate| vectors::<N>(gate, at));
    let (i, f, g) = (sigmoid(level, i), sigmoid(level, f), tanh(level, g));
    let mut out = c;
    for k in 0..N {
        out[k] = level.fma(f[k], c[k], f32x4_mul(i[k], g[k]));
    }
    out
}

/// sigmoid(o) tanh(c)
#[inline(always)]
fn outputs<L: Madd, const N: usize>(level: L, o: &[f32], c: &[f32], at: usize) -> [v128; N] {
    let (o, c) = (sigmoid(level, vectors::<N>(o, at)), tanh(level, vectors::<N>(c, at)));
    let mut out = c;
    for k in 0..N {
        out[k] = f32x4_mul(o[k], c[k]);
    }
    out
}

#[inline(always)]
fn vectors<const N: usize>(from: &[f32], at: usize) -> [v128; N] {
    let mut v = [f32x4_splat(0.0); N];
    for k in 0..N {
        v[k] = load4(from, at + 4 * k);
    }
    v
}
