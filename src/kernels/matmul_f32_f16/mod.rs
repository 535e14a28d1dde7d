//! f32 rows times f16 weights: the contract of [`matmul_f32_f32`](super::matmul_f32_f32), each weight widened exactly to f32.

use half::f16;

pub(crate) use super::matmul_f32_f32::Job;
use super::matmul_f32_f32::body;
use super::packed::Tile;
use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

/// A variant's entry; unsafe to call on a CPU without its level.
pub(crate) type Run = unsafe fn(&Job<'_, f16>, &mut Tile<f32>);

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
