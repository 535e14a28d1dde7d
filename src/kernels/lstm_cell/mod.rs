//! One step of a row of LSTM cells, from the sums of their gates.

use super::operation::operation;

mod scalar;
#[cfg(any(test, feature = "kernel-tests"))]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

operation! {
    /// c = sigmoid(f) c + sigmoid(i) tanh(g) and h = sigmoid(o) tanh(c), `gates` holding i, f, g, o
    /// one after the other, each as long as `c` and `h`.
    LstmCell = "lstm_cell", (fn(gates: &[f32], c: &mut [f32], h: &mut [f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
