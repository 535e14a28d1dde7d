//! Sixteen floats in vector registers: what [`group`](super::group) needs of a level.

/// # Safety
/// Every method is to be called on a CPU with the level's instructions only, from a function compiled for them.
pub(super) trait Sixteen: Copy {
    /// Accumulators of sixteen lanes that fit the register file beside operands.
    const ROOM: usize;

    unsafe fn zero() -> Self;

    unsafe fn splat(v: f32) -> Self;

    /// 16 values at `v`.
    unsafe fn load(v: *const f32) -> Self;

    /// 16 half floats at `v`, widened.
    unsafe fn widen(v: *const half::f16) -> Self;

    /// 16 values to `to`.
    unsafe fn store(self, to: *mut f32);

    /// self + a b, rounded once.
    unsafe fn fma(self, a: Self, b: Self) -> Self;

    /// The lanes' sum in the order of [`crate::kernels::math::fold`].
    unsafe fn fold(self) -> f32;

    /// Asks for the cache line at `line`, which may point anywhere.
    unsafe fn fetch(line: *const u8);
}

/// A stored key or value.
pub(super) trait Stored: Copy {
    /// Exact.
    fn to_f32(self) -> f32;

    /// # Safety
    /// 16 values at `v`; as [`Sixteen`].
    unsafe fn load<L: Sixteen>(v: *const Self) -> L;
}

impl Stored for f32 {
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }

    #[inline(always)]
    unsafe fn load<L: Sixteen>(v: *const Self) -> L {
        // SAFETY: promised by the caller.
        unsafe { L::load(v) }
    }
}

impl Stored for half::f16 {
    #[inline(always)]
    fn to_f32(self) -> f32 {
        self.to_f32_const()
    }

    #[inline(always)]
    unsafe fn load<L: Sixteen>(v: *const Self) -> L {
        // SAFETY: promised by the caller.
        unsafe { L::widen(v) }
    }
}
