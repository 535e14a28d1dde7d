//! Rotary positions of one row, half-split: in each head, (a, b) at (i, i + head_dim/2) becomes (a cos_i - b sin_i, b cos_i + a sin_i).

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

/// Rotates `x`, whole heads of `2 cos.len()` values; `cos` and `sin` have equal lengths, at least 1.
pub(crate) type Run = unsafe fn(x: &mut [f32], cos: &[f32], sin: &[f32]);

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
