//! Rows of activations to int16, each as two rows of int8 that the int8 products take one after the
//! other: x = s (254 high + low).
//!
//! s = max|x| / 32258 and q = round(x / s), half to even; high = round(q / 254) and low = q - 254
//! high, both in -127..=127 (254, not 256: -128 is outside of what the products take). x W' is then
//! s (254 high W' + low W'): the same weights are read once for both rows, the integer sums stay
//! exact, and the rounding is 1/254 of that of [`quantize_rows`](super::quantize_rows). The
//! [`epilogue`](super::epilogue) puts the two sums together.
//!
//! Rows that are tiny, NaN or infinite are treated as there; values past `cols` up to `padded` are
//! zero.

use super::operation::operation;

mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

/// What a step of the high row is worth in steps of the low one.
pub(crate) const BASE: f32 = 254.0;

operation! {
    /// Splits one row: `x` into the high and the low row of `q` (padded as in `quantize_rows`), the
    /// sums of their groups into `sums`; returns s.
    SplitRows = "split_rows", (fn(x: &[f32], q: [&mut [i8]; 2], sums: [&mut [i32]; 2]) -> f32);
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128 => wasm::run)
}
