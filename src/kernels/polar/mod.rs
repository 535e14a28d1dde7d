//! Nearest rotations of 3x3 matrices, 16 at a time.
//!
//! The rotation R that maximises tr(R^T A) is that of the unit quaternion which is the eigenvector
//! to the largest eigenvalue of a symmetric 4x4 matrix K made of A's entries (Horn 1987,
//! "Closed-form solution of absolute orientation using unit quaternions"). K is diagonalised by a
//! fixed number of cyclic Jacobi sweeps, free of branches, so that 16 matrices go through side by
//! side; any eigenvector is a valid rotation, so reflections and lost ranks need no special case.

use super::operation::operation;

mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

operation! {
    /// The nearest rotation of each matrix of `m`; `m` and `out` have equal lengths; row-major.
    Polar = "polar", (fn(m: &[[f32; 9]], out: &mut [[f32; 9]]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
