use std::arch::aarch64::*;

use half::f16;

use super::F32x16;
use crate::kernels::level::compiled;
use crate::kernels::level::token::Neon;

impl F32x16 for Neon {
    type V = [float32x4_t; 4];

    const ROOM: usize = 6;
    const ATTEND_ROOM: usize = 6;

    compiled! { for Neon:
        fn zero(self) -> [float32x4_t; 4] {
            [vdupq_n_f32(0.0); 4]
        }

        fn splat(self, v: f32) -> [float32x4_t; 4] {
            [vdupq_n_f32(v); 4]
        }

        fn load(self, from: &[f32; 16]) -> [float32x4_t; 4] {
            // SAFETY: 4 of 16 values each.
            [0, 4, 8, 12].map(|i| unsafe { vld1q_f32(from.as_ptr().add(i)) })
        }

        fn widen(self, from: &[f16; 16]) -> [float32x4_t; 4] {
            let from = from.as_ptr().cast::<u16>();
            // SAFETY: 4 of 16 values of 2 bytes each.
            [0, 4, 8, 12].map(|i| vcvt_f32_f16(vreinterpret_f16_u16(unsafe { vld1_u16(from.add(i)) })))
        }

        fn store(self, v: [float32x4_t; 4], to: &mut [f32; 16]) {
            for (i, v) in v.into_iter().enumerate() {
                // SAFETY: 4 of 16 values.
                unsafe { vst1q_f32(to.as_mut_ptr().add(4 * i), v) };
            }
        }

        fn fma(self, sum: [float32x4_t; 4], a: [float32x4_t; 4], b: [float32x4_t; 4]) -> [float32x4_t; 4] {
            [
                vfmaq_f32(sum[0], a[0], b[0]),
                vfmaq_f32(sum[1], a[1], b[1]),
                vfmaq_f32(sum[2], a[2], b[2]),
                vfmaq_f32(sum[3], a[3], b[3]),
            ]
        }

        fn fold(self, v: [float32x4_t; 4]) -> f32 {
            let v = vaddq_f32(vaddq_f32(v[0], v[2]), vaddq_f32(v[1], v[3]));
            let v = vadd_f32(vget_low_f32(v), vget_high_f32(v));
            vget_lane_f32::<0>(v) + vget_lane_f32::<1>(v)
        }

        // There is no stable intrinsic, and the hardware follows streams.
        fn prefetch(self, _line: *const u8) {}
    }
}
