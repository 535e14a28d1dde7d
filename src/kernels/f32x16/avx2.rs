use std::arch::x86_64::*;

use half::f16;

use super::F32x16;
use crate::kernels::level::compiled;
use crate::kernels::level::token::Avx2;

impl F32x16 for Avx2 {
    type V = [__m256; 2];

    const ROOM: usize = 6;
    const ATTEND_ROOM: usize = 5;

    compiled! { for Avx2:
        fn zero(self) -> [__m256; 2] {
            [_mm256_setzero_ps(); 2]
        }

        fn splat(self, v: f32) -> [__m256; 2] {
            [_mm256_set1_ps(v); 2]
        }

        fn load(self, from: &[f32; 16]) -> [__m256; 2] {
            // SAFETY: 8 of 16 values each.
            unsafe { [_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(8))] }
        }

        fn widen(self, from: &[f16; 16]) -> [__m256; 2] {
            let from = from.as_ptr().cast::<__m128i>();
            // SAFETY: 8 of 16 values of 2 bytes each.
            let (low, high) = unsafe { (_mm_loadu_si128(from), _mm_loadu_si128(from.add(1))) };
            [_mm256_cvtph_ps(low), _mm256_cvtph_ps(high)]
        }

        fn store(self, v: [__m256; 2], to: &mut [f32; 16]) {
            let to = to.as_mut_ptr();
            // SAFETY: 8 of 16 values each.
            unsafe { (_mm256_storeu_ps(to, v[0]), _mm256_storeu_ps(to.add(8), v[1])) };
        }

        fn fma(self, sum: [__m256; 2], a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
            [_mm256_fmadd_ps(a[0], b[0], sum[0]), _mm256_fmadd_ps(a[1], b[1], sum[1])]
        }

        fn fold(self, v: [__m256; 2]) -> f32 {
            let v = _mm256_add_ps(v[0], v[1]);
            let v = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
            let v = _mm_add_ps(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32(_mm_add_ss(v, _mm_movehdup_ps(v)))
        }

        fn prefetch(self, line: *const u8) {
            _mm_prefetch::<_MM_HINT_T0>(line.cast());
        }
    }
}
