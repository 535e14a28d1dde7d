use std::arch::x86_64::*;

use super::sixteen::Sixteen;
use super::{Head, Row, group};

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn f16(head: &Head<'_, half::f16>, rows: &mut [Row<'_>]) {
    // SAFETY: compiled for the level.
    unsafe { group::attend::<Pair, _>(head, rows) }
}

#[target_feature(enable = "avx2,fma,f16c")]
pub(super) fn f32(head: &Head<'_, f32>, rows: &mut [Row<'_>]) {
    // SAFETY: compiled for the level.
    unsafe { group::attend::<Pair, _>(head, rows) }
}

#[derive(Clone, Copy)]
pub(super) struct Pair([__m256; 2]);

impl Sixteen for Pair {
    const ROOM: usize = 5;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: promised by the caller.
        unsafe { Pair([_mm256_setzero_ps(); 2]) }
    }

    #[inline(always)]
    unsafe fn splat(v: f32) -> Self {
        // SAFETY: promised by the caller.
        unsafe { Pair([_mm256_set1_ps(v); 2]) }
    }

    #[inline(always)]
    unsafe fn load(v: *const f32) -> Self {
        // SAFETY: promised by the caller.
        unsafe { Pair([_mm256_loadu_ps(v), _mm256_loadu_ps(v.add(8))]) }
    }

    #[inline(always)]
    unsafe fn widen(v: *const half::f16) -> Self {
        // SAFETY: promised by the caller.
        unsafe {
            let (low, high) = (_mm_loadu_si128(v.cast()), _mm_loadu_si128(v.add(8).cast()));
            Pair([_mm256_cvtph_ps(low), _mm256_cvtph_ps(high)])
        }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: promised by the caller.
        unsafe {
            _mm256_storeu_ps(to, self.0[0]);
            _mm256_storeu_ps(to.add(8), self.0[1]);
        }
    }

    #[inline(always)]
    unsafe fn fma(self, a: Self, b: Self) -> Self {
        // SAFETY: promised by the caller.
        unsafe { Pair([_mm256_fmadd_ps(a.0[0], b.0[0], self.0[0]), _mm256_fmadd_ps(a.0[1], b.0[1], self.0[1])]) }
    }

    #[inline(always)]
    unsafe fn fold(self) -> f32 {
        // SAFETY: promised by the caller.
        unsafe {
            let v = _mm256_add_ps(self.0[0], self.0[1]);
            let v = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
            let v = _mm_add_ps(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32(_mm_add_ss(v, _mm_movehdup_ps(v)))
        }
    }

    #[inline(always)]
    unsafe fn fetch(line: *const u8) {
        // SAFETY: promised by the caller.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) }
    }
}
