//! Rows of activations to int8: q = round(x 127 / max|x|), half to even, with the scale that undoes
//! it and the sum of each group.
//!
//! A row whose largest magnitude is below 1e-30 becomes zeros with scale 0. A row with a NaN or an
//! infinity becomes zeros with scale NaN, so that it shows in the results. Values past `cols` up to
//! `padded` are zero.

use super::operation::operation;

#[cfg(target_arch = "x86_64")]
mod avx512;
mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(super) mod wasm;

pub(super) use scalar::{MAGIC, largest, scalable};

/// Columns whose values are summed together, for weights with an offset; also the group of int4
/// weights.
pub(crate) const GROUP: usize = 32;

operation! {
    /// Quantises one row: `x` into `q` (a multiple of [`GROUP`] values, at least as many as `x`),
    /// the sums of the groups of `q` into `sums`; returns the scale.
    QuantizeRows = "quantize_rows", (fn(x: &[f32], q: &mut [i8], sums: &mut [i32]) -> f32);
    (Scalar, Neon, Avx2 => scalar::run)
    (Avx512 => avx512::run)
    (Simd128 => wasm::run)
}

/// int8 rows as the integer products take them.
#[derive(Clone, Copy)]
pub(crate) struct Int8Rows<'a> {
    /// Rows, `stride` apart, padded with zeros to whole groups.
    pub(crate) q: &'a [i8],
    /// The same as int16, for variants that ask for it; else empty.
    #[allow(dead_code, reason = "the AVX2 variant of the int8 product alone reads it")]
    pub(crate) wide: &'a [i16],
    /// Sums of each row's groups.
    pub(crate) sums: &'a [i32],
    pub(crate) stride: usize,
    pub(crate) rows: usize,
}

impl Int8Rows<'_> {
    /// What every variant of a product with weights of `padded` columns relies on.
    pub(crate) fn check(&self, padded: usize) {
        assert!((1..=16).contains(&self.rows), "rows 1..=16");
        assert!(self.stride >= padded && self.q.len() >= self.rows * self.stride, "rows are padded");
        assert!(self.sums.len() >= self.rows * (padded / GROUP), "sums of every group");
    }
}
