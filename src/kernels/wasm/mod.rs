//! What the WebAssembly variants share: multiply-adds that round once, exact or relaxed, and the
//! functions of [`math`](super::math) on four lanes.
//!
//! WebAssembly has no fused multiply-add but `relaxed_madd`, which an engine may compute in either
//! of two ways. A variant is written once, for any [`Madd`]: numbers that multiply-adds are made of
//! are held [wide](Madd::Wide), and stay so as long as they can.

use std::arch::wasm32::*;

use super::level::token::Simd128;

mod exact;
mod math;
#[cfg(target_feature = "relaxed-simd")]
mod relaxed;

pub(super) use math::{each, exp, gelu, sigmoid, silu, tanh};

/// Multiply-adds of floats, on a level's token.
pub(super) trait Madd: Copy {
    /// Four floats, as its multiply-adds take and give them.
    type Wide: Copy;

    /// Rows of eight accumulators that fit the register file beside the operands of a product.
    const ROWS: usize;

    /// Exact.
    fn wide(self, v: v128) -> Self::Wide;

    /// Exact.
    fn narrow(self, v: Self::Wide) -> v128;

    /// a b + c, rounded once, of N vectors.
    fn madd<const N: usize>(self, a: [Self::Wide; N], b: [Self::Wide; N], c: [Self::Wide; N]) -> [Self::Wide; N];

    /// a - b, which is a float.
    fn difference(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;

    #[inline(always)]
    fn splat(self, v: f32) -> Self::Wide {
        self.wide(f32x4_splat(v))
    }

    /// a b + c of narrow operands.
    #[inline(always)]
    fn fma(self, a: v128, b: v128, c: v128) -> v128 {
        let [sum] = self.madd([self.wide(a)], [self.wide(b)], [self.wide(c)]);
        self.narrow(sum)
    }
}

/// Four of the values at `from`, `at` of them on.
#[inline(always)]
pub(super) fn load<T: Copy, const N: usize>(from: &[T; N], at: usize) -> v128 {
    assert!(size_of::<T>() * (N - at) >= 16, "a vector's bytes");
    // SAFETY: 16 bytes lie within the array, and any alignment will do.
    unsafe { v128_load(from.as_ptr().add(at).cast()) }
}

/// Four floats from `at` on.
#[inline(always)]
pub(super) fn load4(from: &[f32], at: usize) -> v128 {
    let four = &from[at..at + 4];
    // SAFETY: 16 bytes.
    unsafe { v128_load(four.as_ptr().cast()) }
}

/// Four floats to `at` on.
#[inline(always)]
pub(super) fn store4(to: &mut [f32], at: usize, v: v128) {
    let four = &mut to[at..at + 4];
    // SAFETY: 16 bytes.
    unsafe { v128_store(four.as_mut_ptr().cast(), v) };
}

/// Tests of what is below the operations.
#[cfg(feature = "kernel-tests")]
pub(super) const TESTS: [(&str, fn()); 1] = [("multiply_adds_round_once", exact::tests::multiply_adds_round_once)];
