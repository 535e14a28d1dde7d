//! f32 rows times f32 weights: tile\[r\]\[c\] = sum_k x\[r\]\[k\] w\[c\]\[k\].
//!
//! Contract of a variant: `rows` in 1..=16 rows of `geo.padded()` values, `stride` apart, at `x`, `panels` in 1..=4 panels from `first`;
//! it fills the first `rows` rows and `16 panels` columns of the tile. Sums run over the segments side by side
//! ([`FloatGeometry`]), one fused multiply-add a term, from zero.

use super::packed::{FloatGeometry, Tile};
use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;
#[cfg(target_arch = "aarch64")]
pub(crate) mod neon;
mod scalar;

pub(crate) use scalar::body;

/// Operands of a float product; `W` is the weights' type.
pub(crate) struct Job<'a, W> {
    pub(crate) x: &'a [f32],
    /// From one row of x to the next.
    pub(crate) stride: usize,
    pub(crate) rows: usize,
    pub(crate) weights: &'a [W],
    pub(crate) geo: FloatGeometry,
    pub(crate) first: usize,
    pub(crate) panels: usize,
}

impl<W> Job<'_, W> {
    /// What every variant relies on.
    pub(crate) fn check(&self) {
        assert!((1..=16).contains(&self.rows) && (1..=4).contains(&self.panels), "rows 1..=16, panels 1..=4");
        assert!(self.stride >= self.geo.padded() && self.x.len() >= self.rows * self.stride, "rows of x are padded");
        assert!(self.weights.len() >= (self.first + self.panels) * self.geo.panel, "panels exist");
    }
}

/// A variant's entry; unsafe to call on a CPU without its level.
pub(crate) type Run = unsafe fn(&Job<'_, f32>, &mut Tile<f32>);

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
