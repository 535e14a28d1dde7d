//! Layer normalisation of one row with a shift and a scale vector:
//! y = (x - mean) / sqrt(var + 1e-5) * scale + shift.
//!
//! `var` is the mean square deviation (no Bessel correction). Sums run in 16 lanes, column i into
//! lane i mod 16. `scale` holds 1 + s.

use super::operation::operation;

mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

/// Added to the variance.
pub(crate) const EPSILON: f32 = 1e-5;

operation! {
    /// Normalises one row; the four slices have the same length, at least 1.
    Norm = "norm", (fn(x: &[f32], shift: &[f32], scale: &[f32], y: &mut [f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
