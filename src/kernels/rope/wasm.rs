//! Four pairs at a time; heads of other widths go through the reference.

use std::arch::wasm32::*;

use super::scalar;
use crate::kernels::wasm::{Madd, load4, store4};

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, x: &mut [f32], cos: &[f32], sin: &[f32]) {
    let half = cos.len();
    if !half.is_multiple_of(4) {
        return scalar::run(x, cos, sin);
    }
    assert!(half > 0 && sin.len() == half && x.len().is_multiple_of(2 * half), "rope: whole heads");
    for head in x.chunks_exact_mut(2 * half) {
        let (a, b) = head.split_at_mut(half);
        for at in (0..half).step_by(4) {
            let (u, v, c, s) = (load4(a, at), load4(b, at), load4(cos, at), load4(sin, at));
            store4(a, at, level.fma(u, c, f32x4_neg(f32x4_mul(v, s))));
            store4(b, at, level.fma(v, c, f32x4_mul(u, s)));
        }
    }
}
