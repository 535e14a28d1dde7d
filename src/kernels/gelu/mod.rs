//! Activations in place: GELU in its tanh form, and SiLU x / (1 + e^-x); [`math`](super::math) states their errors.

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

/// The two activations of one variant.
pub(crate) struct Kernel {
    /// In a network it is part of the epilogue; benchmarks and tests run it alone.
    #[cfg_attr(not(feature = "internals"), expect(dead_code))]
    pub(crate) gelu: unsafe fn(&mut [f32]),
    pub(crate) silu: unsafe fn(&mut [f32]),
}

pub(crate) static VARIANTS: &[Variant<Kernel>] = &[
    Variant { name: "scalar", level: Level::Scalar, run: Kernel { gelu: scalar::gelu, silu: scalar::silu } },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx2", level: Level::Avx2, run: Kernel { gelu: avx2::gelu, silu: avx2::silu } },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx512", level: Level::Avx512, run: Kernel { gelu: avx512::gelu, silu: avx512::silu } },
    #[cfg(target_arch = "aarch64")]
    Variant { name: "neon", level: Level::Neon, run: Kernel { gelu: neon::gelu, silu: neon::silu } },
];

#[cfg(test)]
mod tests;
