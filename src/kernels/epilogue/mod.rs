//! What follows a product: scaling, bias, and the activation or the addition to the residual stream.
//!
//! For each column c: t = sum\[c\] (i32 sums: converted, times `x_scale * w_scale[c]`; f32 sums: times `x_scale`), t += bias\[c\],
//! then y\[c\] = t, gelu(t), y\[c\] + t, or fma(gate\[c\], t, y\[c\]).
//!
//! Rows that were [split](super::split_rows) have two sums, and `254 high[c] + low[c]`, both as floats, stands for `sum[c]`.

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

/// One row of sums.
#[derive(Clone, Copy)]
pub(crate) enum Sums<'a> {
    /// Float sums; exact as they are.
    F32(&'a [f32]),
    /// Float sums of quantised activations, times the row's scale.
    Scaled(&'a [f32], f32),
    /// Integer sums, the row's scale, and the scale of each column.
    I32(&'a [i32], f32, &'a [f32]),
    /// As `Scaled`, of a split row: the high sums and the low ones.
    ScaledPair([&'a [f32]; 2], f32),
    /// As `I32`, of a split row.
    I32Pair([&'a [i32]; 2], f32, &'a [f32]),
}

/// What to do with each finished value.
#[derive(Clone, Copy)]
pub(crate) enum Finish<'a> {
    Store,
    Gelu,
    Add,
    GatedAdd(&'a [f32]),
}

/// Finishes one row: as many columns as `y` has; all slices have at least that many values.
pub(crate) type Run = unsafe fn(Sums<'_>, bias: &[f32], Finish<'_>, y: &mut [f32]);

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
