//! Rotary positions of one row, half-split: in each head, (a, b) at (i, i + head_dim/2) becomes
//! (a cos_i - b sin_i, b cos_i + a sin_i).

use super::operation::operation;

mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

operation! {
    /// Rotates `x`, whole heads of `2 cos.len()` values; `cos` and `sin` have equal lengths, at
    /// least 1.
    Rope = "rope", (fn(x: &mut [f32], cos: &[f32], sin: &[f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
