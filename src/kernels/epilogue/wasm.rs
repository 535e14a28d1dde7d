//! Four columns at a time; what is left over goes through the reference.

use std::arch::wasm32::*;

use super::{Finish, RowSums, Sums, scalar};
use crate::kernels::packed::TILE_COLS;
use crate::kernels::split_rows::BASE;
use crate::kernels::wasm::{Madd, each, gelu, load4};

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    assert!(y.len() <= TILE_COLS, "one tile");
    match sums {
        Sums::F32(RowSums::Whole(sums), scale) => {
            let scale = f32x4_splat(scale);
            let value = |at| f32x4_mul(load4(sums, at), scale);
            columns(level, value, bias, finish, y);
        }
        Sums::F32(RowSums::Split([high, low]), scale) => {
            let scale = f32x4_splat(scale);
            let value = |at| f32x4_mul(joined(load4(high, at), load4(low, at)), scale);
            columns(level, value, bias, finish, y);
        }
        Sums::I32(RowSums::Whole(sums), x_scale, w_scale) => {
            let x_scale = f32x4_splat(x_scale);
            let value = |at| f32x4_mul(converted(sums, at), f32x4_mul(x_scale, load4(w_scale, at)));
            columns(level, value, bias, finish, y);
        }
        Sums::I32(RowSums::Split([high, low]), x_scale, w_scale) => {
            let x_scale = f32x4_splat(x_scale);
            let value = |at| {
                let sum = joined(converted(high, at), converted(low, at));
                f32x4_mul(sum, f32x4_mul(x_scale, load4(w_scale, at)))
            };
            columns(level, value, bias, finish, y);
        }
    }
    let done = y.len() / 4 * 4;
    if done < y.len() {
        let finish = match finish {
            Finish::GatedAdd(gate) => Finish::GatedAdd(&gate[done..]),
            other => other,
        };
        scalar::run(sums.from(done), &bias[done..], finish, &mut y[done..]);
    }
}

/// `value(at)`: the scaled sums of columns `at .. at + 4`.
#[inline(always)]
fn columns<L: Madd>(level: L, value: impl Fn(usize) -> v128, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    let value = |at| f32x4_add(value(at), load4(bias, at));
    match finish {
        Finish::Store => each(y, |_, at| values(&value, at), |_, at| values(&value, at)),
        Finish::Gelu => each(y, |_, at| gelu(level, values(&value, at)), |_, at| gelu(level, values(&value, at))),
        Finish::Add => each(y, |y, at| sum(y, values(&value, at)), |y, at| sum(y, values(&value, at))),
        Finish::GatedAdd(gate) => {
            let gate = |at| load4(gate, at);
            each(
                y,
                |y, at| gated(level, values(gate, at), values(&value, at), y),
                |y, at| gated(level, values(gate, at), values(&value, at), y),
            )
        }
    };
}

/// N vectors from column `at` on.
#[inline(always)]
fn values<const N: usize>(value: impl Fn(usize) -> v128, at: usize) -> [v128; N] {
    let mut out = [f32x4_splat(0.0); N];
    for i in 0..N {
        out[i] = value(at + 4 * i);
    }
    out
}

#[inline(always)]
fn sum<const N: usize>(mut y: [v128; N], t: [v128; N]) -> [v128; N] {
    for i in 0..N {
        y[i] = f32x4_add(y[i], t[i]);
    }
    y
}

#[inline(always)]
fn gated<L: Madd, const N: usize>(level: L, gate: [v128; N], t: [v128; N], mut y: [v128; N]) -> [v128; N] {
    let zero = [level.splat(0.0); N];
    let (mut g, mut w, mut sum) = (zero, zero, zero);
    for i in 0..N {
        (g[i], w[i], sum[i]) = (level.wide(gate[i]), level.wide(t[i]), level.wide(y[i]));
    }
    let sum = level.madd(g, w, sum);
    for i in 0..N {
        y[i] = level.narrow(sum[i]);
    }
    y
}

#[inline(always)]
fn converted(sums: &[i32], at: usize) -> v128 {
    let four = &sums[at..at + 4];
    // SAFETY: 16 bytes.
    f32x4_convert_i32x4(unsafe { v128_load(four.as_ptr().cast()) })
}

#[inline(always)]
fn joined(high: v128, low: v128) -> v128 {
    f32x4_add(f32x4_mul(f32x4_splat(BASE), high), low)
}
