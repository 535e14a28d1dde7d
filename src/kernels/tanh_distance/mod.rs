//! How far two vectors are from each other, between 0 and 1: tanh |a - b|;
//! [`math::tanh`](super::math::tanh) states its error.

use super::operation::operation;

mod scalar;
#[cfg(any(test, feature = "kernel-tests"))]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

operation! {
    /// y = tanh |a - b|; all of one length.
    TanhDistance = "tanh_distance", (fn(a: &[f32], b: &[f32], y: &mut [f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
