//! Sixteen columns at a time; rows of other lengths go through the reference.

use std::arch::wasm32::*;

use super::{EPSILON, scalar};
use crate::kernels::f32x16::F32x16;
use crate::kernels::wasm::{Madd, load, load4, store4};

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, x: &[f32], shift: &[f32], scale: &[f32], y: &mut [f32]) {
    let n = x.len();
    if !n.is_multiple_of(16) {
        return scalar::run(x, shift, scale, y);
    }
    assert!(n > 0 && shift.len() == n && scale.len() == n && y.len() == n, "norm: equal lengths");
    let mut sum = [f32x4_splat(0.0); 4];
    for chunk in x.as_chunks::<16>().0 {
        for i in 0..4 {
            sum[i] = f32x4_add(sum[i], load(chunk, 4 * i));
        }
    }
    let fold = |v: [v128; 4]| level.fold([level.wide(v[0]), level.wide(v[1]), level.wide(v[2]), level.wide(v[3])]);
    let mean = f32x4_splat(fold(sum) / n as f32);
    let mut square = level.zero();
    for chunk in x.as_chunks::<16>().0 {
        let mut d = level.zero();
        for i in 0..4 {
            d[i] = level.wide(f32x4_sub(load(chunk, 4 * i), mean));
        }
        square = level.madd16(d, d, square);
    }
    let rstd = f32x4_splat(1.0 / (level.fold(square) / n as f32 + EPSILON).sqrt());
    for at in (0..n).step_by(4) {
        let v = f32x4_mul(f32x4_sub(load4(x, at), mean), rstd);
        store4(y, at, level.fma(v, load4(scale, at), load4(shift, at)));
    }
}
