use std::arch::x86_64::*;

use super::GROUP;
use super::scalar::{self, MAGIC, TINY};

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,f16c")]
pub(super) fn run(x: &[f32], q: &mut [i8], sums: &mut [i32]) -> f32 {
    let n = x.len();
    if !n.is_multiple_of(4 * GROUP) || q.len() != n || sums.len() * GROUP != n {
        return scalar::run(x, q, sums);
    }
    // Four registers wait less for each other than one.
    let mut tops = [_mm512_setzero_si512(); 4];
    let magnitude = _mm512_set1_epi32(0x7fff_ffff);
    for chunk in x.as_chunks::<64>().0 {
        for (i, top) in tops.iter_mut().enumerate() {
            // SAFETY: 16 of 64 values.
            let v = unsafe { _mm512_loadu_si512(chunk.as_ptr().add(16 * i).cast()) };
            *top = _mm512_max_epu32(*top, _mm512_and_si512(v, magnitude));
        }
    }
    let [a, b, c, d] = tops;
    let top = f32::from_bits(_mm512_reduce_max_epu32(_mm512_max_epu32(_mm512_max_epu32(a, b), _mm512_max_epu32(c, d))));
    if !(TINY..f32::INFINITY).contains(&top) {
        return scalar::run(x, q, sums);
    }
    let (inverse, magic) = (_mm512_set1_ps(127.0 / top), _mm512_set1_ps(MAGIC));
    for ((x, q), sum) in x.as_chunks::<GROUP>().0.iter().zip(q.as_chunks_mut::<GROUP>().0).zip(sums) {
        let halves: [__m512i; 2] = std::array::from_fn(|i| {
            // SAFETY: 16 of 32 values.
            let v = unsafe { _mm512_loadu_ps(x.as_ptr().add(16 * i)) };
            // The integer less the bits of MAGIC: exact, since both lie in one binade.
            let t = _mm512_castps_si512(_mm512_add_ps(_mm512_mul_ps(v, inverse), magic));
            _mm512_sub_epi32(t, _mm512_castps_si512(magic))
        });
        for (i, half) in halves.into_iter().enumerate() {
            // SAFETY: 16 of 32 bytes.
            unsafe { _mm_storeu_si128(q.as_mut_ptr().add(16 * i).cast(), _mm512_cvtepi32_epi8(half)) };
        }
        *sum = _mm512_reduce_add_epi32(_mm512_add_epi32(halves[0], halves[1]));
    }
    top / 127.0
}
