//! Activations in place: GELU in its tanh form, and SiLU x / (1 + e^-x); [`math`](super::math)
//! states their errors.

use super::operation::operation;

mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

/// Which activation.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Activation {
    /// In a network it is part of the epilogue; benchmarks and tests run it alone.
    #[cfg_attr(not(feature = "internals"), expect(dead_code))]
    Gelu,
    Silu,
}

operation! {
    /// Replaces each value of `x` by what the activation makes of it.
    Activate = "gelu", (fn(activation: Activation, x: &mut [f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
