//! Rows of activations to int8: q = round(x 127 / max|x|), half to even, with the scale that undoes it and the sum of each group.
//!
//! A row whose largest magnitude is below 1e-30 becomes zeros with scale 0. A row with a NaN or an infinity becomes zeros
//! with scale NaN, so that it shows in the results. Values past `cols` up to `padded` are zero.

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

pub(super) use scalar::{MAGIC, largest, scalable};

/// Columns whose values are summed together, for weights with an offset; also the group of int4 weights.
pub(crate) const GROUP: usize = 32;

/// Quantises one row: `x` into `q` (a multiple of [`GROUP`] values, at least as many as `x`), the sums of the groups of `q`
/// into `sums`; returns the scale.
pub(crate) type Run = unsafe fn(x: &[f32], q: &mut [i8], sums: &mut [i32]) -> f32;

pub(crate) static VARIANTS: &[Variant<Run>] = &[
    Variant { name: "scalar", level: Level::Scalar, run: scalar::run },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx2", level: Level::Avx2, run: avx2::run },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx512", level: Level::Avx512, run: avx512::run },
    #[cfg(target_arch = "aarch64")]
    Variant { name: "neon", level: Level::Neon, run: neon::run },
];

#[cfg(test)]
mod tests;
