//! f32 rows times f16 weights: the contract of [`matmul_f32_f32`](super::matmul_f32_f32), each
//! weight widened exactly to f32.

use half::f16;

use super::matmul_f32_f32::Job;
use super::matmul_f32_f32::scalar;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_feature = "simd128"))]
use super::matmul_f32_f32::simd;
use super::operation::operation;
use super::packed::Tile;

#[cfg(test)]
mod tests;

operation! {
    /// The product of a [`Job`] that [`Job::check`] accepts.
    MatmulF32F16 = "matmul_f32_f16", (fn(job: &Job<'_, f16>, tile: &mut Tile<f32>));
    (Scalar => scalar::run)
    (Neon, Avx2, Avx512, Simd128, Relaxed => simd::run, token)
}
