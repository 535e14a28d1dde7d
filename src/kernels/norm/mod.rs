//! Layer normalisation of one row with a shift and a scale vector: y = (x - mean) / sqrt(var + 1e-5) * scale + shift.
//!
//! `var` is the mean square deviation (no Bessel correction). Sums run in 16 lanes, column i into lane i mod 16. `scale` holds 1 + s.

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

/// Added to the variance.
pub(crate) const EPSILON: f32 = 1e-5;

/// One row; the four slices have the same length, at least 1.
pub(crate) type Run = unsafe fn(x: &[f32], shift: &[f32], scale: &[f32], y: &mut [f32]);

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
