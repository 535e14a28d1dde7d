//! Nearest rotations of 3x3 matrices, 16 at a time.
//!
//! The rotation R that maximises tr(R^T A) is that of the unit quaternion which is the eigenvector to the largest eigenvalue of a
//! symmetric 4x4 matrix K made of A's entries (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions").
//! K is diagonalised by a fixed number of cyclic Jacobi sweeps, free of branches, so that 16 matrices go through side by side; any
//! eigenvector is a valid rotation, so reflections and lost ranks need no special case.

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

/// `m` and `out` have equal lengths; row-major.
pub(crate) type Run = unsafe fn(m: &[[f32; 9]], out: &mut [[f32; 9]]);

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
