use std::arch::aarch64::*;

use super::sixteen::Sixteen;
use super::{Head, Row, group};

#[target_feature(enable = "neon")]
pub(super) fn f16(head: &Head<'_, half::f16>, rows: &mut [Row<'_>]) {
    // SAFETY: compiled for the level.
    unsafe { group::attend::<Quad, _>(head, rows) }
}

#[target_feature(enable = "neon")]
pub(super) fn f32(head: &Head<'_, f32>, rows: &mut [Row<'_>]) {
    // SAFETY: compiled for the level.
    unsafe { group::attend::<Quad, _>(head, rows) }
}

#[derive(Clone, Copy)]
pub(super) struct Quad([float32x4_t; 4]);

impl Sixteen for Quad {
    const ROOM: usize = 6;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: promised by the caller.
        unsafe { Quad([vdupq_n_f32(0.0); 4]) }
    }

    #[inline(always)]
    unsafe fn splat(v: f32) -> Self {
        // SAFETY: promised by the caller.
        unsafe { Quad([vdupq_n_f32(v); 4]) }
    }

    #[inline(always)]
    unsafe fn load(v: *const f32) -> Self {
        // SAFETY: promised by the caller.
        unsafe { Quad([vld1q_f32(v), vld1q_f32(v.add(4)), vld1q_f32(v.add(8)), vld1q_f32(v.add(12))]) }
    }

    #[inline(always)]
    unsafe fn widen(v: *const half::f16) -> Self {
        // SAFETY: promised by the caller.
        unsafe {
            let quad = |i: usize| vcvt_f32_f16(vreinterpret_f16_u16(vld1_u16(v.cast::<u16>().add(i))));
            Quad([quad(0), quad(4), quad(8), quad(12)])
        }
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: promised by the caller.
        unsafe {
            vst1q_f32(to, self.0[0]);
            vst1q_f32(to.add(4), self.0[1]);
            vst1q_f32(to.add(8), self.0[2]);
            vst1q_f32(to.add(12), self.0[3]);
        }
    }

    #[inline(always)]
    unsafe fn fma(self, a: Self, b: Self) -> Self {
        // SAFETY: promised by the caller.
        unsafe {
            let (c, a, b) = (self.0, a.0, b.0);
            Quad([
                vfmaq_f32(c[0], a[0], b[0]),
                vfmaq_f32(c[1], a[1], b[1]),
                vfmaq_f32(c[2], a[2], b[2]),
                vfmaq_f32(c[3], a[3], b[3]),
            ])
        }
    }

    #[inline(always)]
    unsafe fn fold(self) -> f32 {
        // SAFETY: promised by the caller.
        unsafe {
            let v = vaddq_f32(vaddq_f32(self.0[0], self.0[2]), vaddq_f32(self.0[1], self.0[3]));
            let v = vadd_f32(vget_low_f32(v), vget_high_f32(v));
            vget_lane_f32::<0>(v) + vget_lane_f32::<1>(v)
        }
    }

    #[inline(always)]
    unsafe fn fetch(_: *const u8) {
        // There is no stable intrinsic, and the hardware follows streams.
    }
}
