//! Whole vectors; what is left over goes through the reference.

use super::{Activation, scalar};
use crate::kernels::wasm::{Madd, each, gelu, silu};

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, activation: Activation, x: &mut [f32]) {
    let done = match activation {
        Activation::Gelu => each(x, |v, _| gelu(level, v), |v, _| gelu(level, v)),
        Activation::Silu => each(x, |v, _| silu(level, v), |v, _| silu(level, v)),
    };
    scalar::run(activation, &mut x[done..]);
}
