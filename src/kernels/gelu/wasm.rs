//! Four values at a time; what is left over goes through the reference.

use super::{Activation, scalar};
use crate::kernels::wasm::{Madd, gelu, load4, silu, store4};

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, activation: Activation, x: &mut [f32]) {
    let whole = x.len() / 4 * 4;
    let (whole, rest) = x.split_at_mut(whole);
    for at in (0..whole.len()).step_by(4) {
        let v = load4(whole, at);
        let v = match activation {
            Activation::Gelu => gelu(level, v),
            Activation::Silu => silu(level, v),
        };
        store4(whole, at, v);
    }
    scalar::run(activation, rest);
}
