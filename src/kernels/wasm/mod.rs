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

pub(super) use math::{exp, gelu, silu};
#[cfg(target_feature = "relaxed-simd")]
pub(super) use relaxed::{Dot, dot, is_fused};

/// Multiply-adds of floats, on a level's token.
pub(super) trait Madd: Copy {
    /// Four floats, as its multiply-adds take and give them.
    type Wide: Copy;

    /// Accumulators of sixteen floats that fit the register file beside the operands of a product.
    const ROOM: usize;

    /// Exact.
    fn wide(self, v: v128) -> Self::Wide;

    /// Exact.
    fn narrow(self, v: Self::Wide) -> v128;

    /// a b + c, rounded once.
    fn madd(self, a: Self::Wide, b: Self::Wide, c: Self::Wide) -> Self::Wide;

    /// The same four times.
    fn madd16(self, a: [Self::Wide; 4], b: [Self::Wide; 4], c: [Self::Wide; 4]) -> [Self::Wide; 4];

    /// a - b, which is a float.
    fn difference(self, a: Self::Wide, b: Self::Wide) -> Self::Wide;

    fn splat(self, v: f32) -> Self::Wide {
        self.wide(f32x4_splat(v))
    }

    /// a b + c of narrow operands.
    fn fma(self, a: v128, b: v128, c: v128) -> v128 {
        self.narrow(self.madd(self.wide(a), self.wide(b), self.wide(c)))
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

/// What is left of a row behind its last whole vector goes through `four` with zeros behind it.
#[inline(always)]
pub(super) fn padded<const N: usize>(rest: [&[f32]; N]) -> [[f32; 4]; N] {
    let mut out = [[0.0; 4]; N];
    for (out, rest) in out.iter_mut().zip(rest) {
        out[..rest.len()].copy_from_slice(rest);
    }
    out
}
