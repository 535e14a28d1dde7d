//! Sixteen floats side by side in vector registers, on each level's token: what float products and
//! attention are written with, once for every level.

use half::f16;

use super::math;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

/// The floats' operations, all rounded as in scalar code; `fma` rounds once.
pub(super) trait F32x16: Copy {
    /// Sixteen floats.
    type V: Copy;

    /// Accumulators of sixteen floats that fit the register file beside the operands of a product.
    const ROOM: usize;

    /// The same for attention, which has more operands at once.
    const ATTEND_ROOM: usize;

    fn zero(self) -> Self::V;

    fn splat(self, v: f32) -> Self::V;

    fn load(self, from: &[f32; 16]) -> Self::V;

    /// Exact.
    fn widen(self, from: &[f16; 16]) -> Self::V;

    fn store(self, v: Self::V, to: &mut [f32; 16]);

    /// sum + a b
    fn fma(self, sum: Self::V, a: Self::V, b: Self::V) -> Self::V;

    /// The sum of the lanes in the order of [`math::fold`].
    fn fold(self, v: Self::V) -> f32;

    /// e^(v - top) in place of each v of whole registers.
    #[inline(always)]
    fn exp(self, values: &mut [f32], top: f32) {
        values.iter_mut().for_each(|v| *v = math::exp(*v - top));
    }

    /// Asks for the cache line at `line`, which may point anywhere.
    fn prefetch(self, line: *const u8);
}

/// A number as weights, keys and values are stored.
pub(super) trait Stored: Copy {
    /// Exact.
    fn to_f32(self) -> f32;

    /// Sixteen of them, widened.
    fn load<L: F32x16>(level: L, from: &[Self; 16]) -> L::V;
}

impl Stored for f32 {
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }

    #[inline(always)]
    fn load<L: F32x16>(level: L, from: &[Self; 16]) -> L::V {
        level.load(from)
    }
}

impl Stored for f16 {
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self.to_f32_const()
    }

    #[inline(always)]
    fn load<L: F32x16>(level: L, from: &[Self; 16]) -> L::V {
        level.widen(from)
    }
}
