//! f32 rows times f32 weights: tile\[r\]\[c\] = sum_k x\[r\]\[k\] w\[c\]\[k\].
//!
//! A variant fills as many rows as there are, and 16 columns per panel, of the tile. Sums run over
//! the segments side by side ([`FloatGeometry`]), one fused multiply-add per term, from zero.

use super::operation::operation;
use super::packed::{FloatGeometry, Panels, Tile};

pub(crate) mod scalar;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_feature = "simd128"))]
pub(crate) mod simd;
#[cfg(test)]
pub(crate) mod tests;

/// Operands of a float product; `W` is the weights' type.
pub(crate) struct Job<'a, W> {
    /// 1 to 16 rows of `geo.padded()` values, `stride` apart.
    pub(crate) x: &'a [f32],
    pub(crate) stride: usize,
    pub(crate) rows: usize,
    pub(crate) weights: &'a [W],
    pub(crate) geo: FloatGeometry,
    pub(crate) panels: Panels,
}

impl<W> Job<'_, W> {
    /// What every variant relies on.
    pub(crate) fn check(&self) {
        assert!((1..=16).contains(&self.rows), "rows 1..=16");
        assert!(self.stride >= self.geo.padded() && self.x.len() >= self.rows * self.stride, "rows of x are padded");
        self.panels.check(self.weights.len(), self.geo.panel);
    }
}

operation! {
    /// The product of a [`Job`] that [`Job::check`] accepts.
    MatmulF32F32 = "matmul_f32_f32", (fn(job: &Job<'_, f32>, tile: &mut Tile<f32>));
    (Scalar => scalar::run)
    (Neon, Avx2, Avx512, Simd128, Relaxed => simd::run, token)
}
