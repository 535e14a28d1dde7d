use std::arch::wasm32::*;

use half::f16;

use super::F32x16;
use crate::kernels::wasm::{Madd, exp, load, load4, store4};

impl<L: Madd> F32x16 for L {
    type V = [L::Wide; 4];

    const ROOM: usize = L::ROOM;
    const ATTEND_ROOM: usize = L::ROOM;

    #[inline(always)]
    fn zero(self) -> [L::Wide; 4] {
        [Madd::splat(self, 0.0); 4]
    }

    #[inline(always)]
    fn splat(self, v: f32) -> [L::Wide; 4] {
        [Madd::splat(self, v); 4]
    }

    #[inline(always)]
    fn load(self, from: &[f32; 16]) -> [L::Wide; 4] {
        [self.wide(load(from, 0)), self.wide(load(from, 4)), self.wide(load(from, 8)), self.wide(load(from, 12))]
    }

    #[inline(always)]
    fn widen(self, from: &[f16; 16]) -> [L::Wide; 4] {
        let (a, b) = (load(from, 0), load(from, 8));
        let parts = [
            i32x4_extend_low_i16x8(a),
            i32x4_extend_high_i16x8(a),
            i32x4_extend_low_i16x8(b),
            i32x4_extend_high_i16x8(b),
        ];
        [
            self.wide(half_to_float(parts[0])),
            self.wide(half_to_float(parts[1])),
            self.wide(half_to_float(parts[2])),
            self.wide(half_to_float(parts[3])),
        ]
    }

    #[inline(always)]
    fn store(self, v: [L::Wide; 4], to: &mut [f32; 16]) {
        for i in 0..4 {
            // SAFETY: 4 of 16 values.
            unsafe { v128_store(to.as_mut_ptr().add(4 * i).cast(), self.narrow(v[i])) };
        }
    }

    #[inline(always)]
    fn fma(self, sum: [L::Wide; 4], a: [L::Wide; 4], b: [L::Wide; 4]) -> [L::Wide; 4] {
        self.madd16(a, b, sum)
    }

    #[inline(always)]
    fn fold(self, v: [L::Wide; 4]) -> f32 {
        let (a, b) = (f32x4_add(self.narrow(v[0]), self.narrow(v[2])), f32x4_add(self.narrow(v[1]), self.narrow(v[3])));
        let v = f32x4_add(a, b);
        let v = f32x4_add(v, i64x2_shuffle::<1, 1>(v, v));
        f32x4_extract_lane::<0>(v) + f32x4_extract_lane::<1>(v)
    }

    #[inline(always)]
    fn exp(self, values: &mut [f32], top: f32) {
        let top = f32x4_splat(top);
        for at in (0..values.len()).step_by(4) {
            store4(values, at, exp(self, f32x4_sub(load4(values, at), top)));
        }
    }

    // There is no such instruction.
    #[inline(always)]
    fn prefetch(self, _line: *const u8) {}
}

/// Half floats, sign-extended to 32 bits, as floats: sign, exponent and mantissa go to their
/// places, and a power of two makes up for the difference of the exponents' bias; denormals come
/// out right as well. Infinities and NaN get the largest exponent back.
#[inline(always)]
fn half_to_float(v: v128) -> v128 {
    let bits = v128_and(i32x4_shl(v, 13), i32x4_splat(0x8fff_e000_u32 as i32));
    let special = i32x4_gt(v128_and(bits, i32x4_splat(0x7fff_ffff)), i32x4_splat(0x0f7f_ffff));
    let scaled = f32x4_mul(bits, f32x4_splat(f32::from_bits((127 + 112) << 23)));
    v128_or(scaled, v128_and(special, i32x4_splat(0x7f80_0000)))
}
