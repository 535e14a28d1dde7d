//! How far two vectors are from each other, between 0 and 1: tanh |a - b|;
//! [`math::tanh`](super::math::tanh) states its error.

use super::operation::operation;

mod scalar;
#[cfg(test)]
mod tests;

operation! {
    /// y = tanh |a - b|; all of one length.
    TanhDistance = "tanh_distance", (fn(a: &[f32], b: &[f32], y: &mut [f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
}
