//! Four columns at a time; what is left over goes through the reference.

use std::arch::wasm32::*;

use super::{Finish, RowSums, Sums, scalar};
use crate::kernels::packed::TILE_COLS;
use crate::kernels::split_rows::BASE;
use crate::kernels::wasm::{Madd, gelu, load4, store4};

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    assert!(y.len() <= TILE_COLS, "one tile");
    match sums {
        Sums::F32(RowSums::Whole(sums), scale) => {
            let scale = f32x4_splat(scale);
            let value = |at| f32x4_mul(load4(sums, at), scale);
            each(level, value, bias, finish, y);
        }
        Sums::F32(RowSums::Split([high, low]), scale) => {
            let scale = f32x4_splat(scale);
            let value = |at| f32x4_mul(joined(load4(high, at), load4(low, at)), scale);
            each(level, value, bias, finish, y);
        }
        Sums::I32(RowSums::Whole(sums), x_scale, w_scale) => {
            let x_scale = f32x4_splat(x_scale);
            let value = |at| f32x4_mul(converted(sums, at), f32x4_mul(x_scale, load4(w_scale, at)));
            each(level, value, bias, finish, y);
        }
        Sums::I32(RowSums::Split([high, low]), x_scale, w_scale) => {
            let x_scale = f32x4_splat(x_scale);
            let value = |at| {
                let sum = joined(converted(high, at), converted(low, at));
                f32x4_mul(sum, f32x4_mul(x_scale, load4(w_scale, at)))
            };
            each(level, value, bias, finish, y);
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
fn each<L: Madd>(level: L, value: impl Fn(usize) -> v128, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    let columns = (0..y.len() / 4).map(|i| 4 * i);
    let value = |at| f32x4_add(value(at), load4(bias, at));
    match finish {
        Finish::Store => columns.for_each(|at| store4(y, at, value(at))),
        Finish::Gelu => columns.for_each(|at| store4(y, at, gelu(level, value(at)))),
        Finish::Add => columns.for_each(|at| store4(y, at, f32x4_add(load4(y, at), value(at)))),
        Finish::GatedAdd(gate) => {
            columns.for_each(|at| store4(y, at, level.fma(load4(gate, at), value(at), load4(y, at))));
        }
    }
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
