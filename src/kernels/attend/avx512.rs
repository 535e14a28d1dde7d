use std::arch::x86_64::*;

use super::sixteen::Sixteen;
use super::{Head, Row, group};

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn f16(head: &Head<'_, half::f16>, rows: &mut [Row<'_>]) {
    // SAFETY: compiled for the level.
    unsafe { group::attend::<__m512, _>(head, rows) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn f32(head: &Head<'_, f32>, rows: &mut [Row<'_>]) {
    // SAFETY: compiled for the level.
    unsafe { group::attend::<__m512, _>(head, rows) }
}

impl Sixteen for __m512 {
    const ROOM: usize = 24;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: promised by the caller.
        unsafe { _mm512_setzero_ps() }
    }

    #[inline(always)]
    unsafe fn splat(v: f32) -> Self {
        // SAFETY: promised by the caller.
        unsafe { _mm512_set1_ps(v) }
    }

    #[inline(always)]
    unsafe fn load(v: *const f32) -> Self {
        // SAFETY: promised by the caller.
        unsafe { _mm512_loadu_ps(v) }
    }

    #[inline(always)]
    unsafe fn widen(v: *const half::f16) -> Self {
        // SAFETY: promised by the caller.
        unsafe { _mm512_cvtph_ps(_mm256_loadu_si256(v.cast())) }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: promised by the caller.
        unsafe { _mm512_storeu_ps(to, self) }
    }

    #[inline(always)]
    unsafe fn fma(self, a: Self, b: Self) -> Self {
        // SAFETY: promised by the caller.
        unsafe { _mm512_fmadd_ps(a, b, self) }
    }

    #[inline(always)]
    unsafe fn fold(self) -> f32 {
        // SAFETY: promised by the caller.
        unsafe {
            let v = _mm256_add_ps(_mm512_castps512_ps256(self), _mm512_extractf32x8_ps::<1>(self));
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
