use std::arch::x86_64::*;

use half::f16;

use super::F32x16;
use crate::kernels::level::compiled;
use crate::kernels::level::token::Avx512;

impl F32x16 for Avx512 {
    type V = __m512;

    const ROOM: usize = 24;
    const ATTEND_ROOM: usize = 24;

    compiled! { for Avx512:
        fn zero(self) -> __m512 {
            _mm512_setzero_ps()
        }

        fn splat(self, v: f32) -> __m512 {
            _mm512_set1_ps(v)
        }

        fn load(self, from: &[f32; 16]) -> __m512 {
            // SAFETY: 16 values.
            unsafe { _mm512_loadu_ps(from.as_ptr()) }
        }

        fn widen(self, from: &[f16; 16]) -> __m512 {
            // SAFETY: 16 values of 2 bytes.
            _mm512_cvtph_ps(unsafe { _mm256_loadu_si256(from.as_ptr().cast()) })
        }

        fn store(self, v: __m512, to: &mut [f32; 16]) {
            // SAFETY: 16 values.
            unsafe { _mm512_storeu_ps(to.as_mut_ptr(), v) }
        }

        fn fma(self, sum: __m512, a: __m512, b: __m512) -> __m512 {
            _mm512_fmadd_ps(a, b, sum)
        }

        fn fold(self, v: __m512) -> f32 {
            let v = _mm256_add_ps(_mm512_castps512_ps256(v), _mm512_extractf32x8_ps::<1>(v));
            let v = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
            let v = _mm_add_ps(v, _mm_movehl_ps(v, v));
            _mm_cvtss_f32(_mm_add_ss(v, _mm_movehdup_ps(v)))
        }

        fn prefetch(self, line: *const u8) {
            _mm_prefetch::<_MM_HINT_T0>(line.cast());
        }
    }
}
