//! Multiply-adds through f64, two lanes at a time.
//!
//! A product of floats is exact in f64, so their sum is rounded twice, first to 53 bits and then to
//! 24. That differs from rounding once only where the first rounding gave a tie of the second one,
//! which is found by its 29 lowest bits and put right. (As in libm's `fmaf`, which the reference
//! calls, ties among denormals are not looked for: they would take sums that are denormal all
//! along.)

use std::arch::wasm32::*;

use super::{Madd, Simd128};

/// A tie's 29 lowest bits, moved to the top of a word.
const TIE: i32 = i32::MIN;

impl Madd for Simd128 {
    type Wide = [v128; 2];

    const ROWS: usize = 2;

    #[inline(always)]
    fn wide(self, v: v128) -> [v128; 2] {
        [f64x2_promote_low_f32x4(v), f64x2_promote_low_f32x4(i64x2_shuffle::<1, 1>(v, v))]
    }

    #[inline(always)]
    fn narrow(self, v: [v128; 2]) -> v128 {
        i64x2_shuffle::<0, 2>(f32x4_demote_f64x2_zero(v[0]), f32x4_demote_f64x2_zero(v[1]))
    }

    #[inline(always)]
    fn madd<const N: usize>(self, a: [[v128; 2]; N], b: [[v128; 2]; N], c: [[v128; 2]; N]) -> [[v128; 2]; N] {
        let mut sum = c;
        let mut least = i32x4_splat(0);
        for i in 0..N {
            sum[i] = sums(a[i], b[i], c[i]);
            // A tie is the least of all words.
            least = i32x4_min(least, low_bits(sum[i]));
        }
        if v128_any_true(i32x4_eq(least, i32x4_splat(TIE))) {
            for i in 0..N {
                sum[i] = settled(a[i], b[i], c[i]);
            }
        }
        for i in 0..N {
            sum[i] = round(sum[i]);
        }
        sum
    }

    #[inline(always)]
    fn difference(self, a: [v128; 2], b: [v128; 2]) -> [v128; 2] {
        [f64x2_sub(a[0], b[0]), f64x2_sub(a[1], b[1])]
    }
}

/// Rounded to 53 bits.
#[inline(always)]
fn sums(a: [v128; 2], b: [v128; 2], c: [v128; 2]) -> [v128; 2] {
    [f64x2_add(f64x2_mul(a[0], b[0]), c[0]), f64x2_add(f64x2_mul(a[1], b[1]), c[1])]
}

/// The 29 lowest bits of each sum, at the top of a word.
#[inline(always)]
fn low_bits(sum: [v128; 2]) -> v128 {
    i32x4_shl(i32x4_shuffle::<0, 2, 4, 6>(sum[0], sum[1]), 3)
}

/// To floats.
#[inline(always)]
fn round(sum: [v128; 2]) -> [v128; 2] {
    [f64x2_promote_low_f32x4(f32x4_demote_f64x2_zero(sum[0])), f64x2_promote_low_f32x4(f32x4_demote_f64x2_zero(sum[1]))]
}

/// The sums with ties moved to the side on which the exact sum lies.
#[cold]
#[inline(never)]
fn settled(a: [v128; 2], b: [v128; 2], c: [v128; 2]) -> [v128; 2] {
    let lanes = |v: v128| [f64x2_extract_lane::<0>(v), f64x2_extract_lane::<1>(v)];
    let mut out = sums(a, b, c);
    for i in 0..2 {
        let (a, b, c) = (lanes(a[i]), lanes(b[i]), lanes(c[i]));
        out[i] = f64x2(settle(a[0] * b[0], c[0]), settle(a[1] * b[1], c[1]));
    }
    out
}

/// p + c, so that rounding it to a float is as if it had been rounded once.
fn settle(p: f64, c: f64) -> f64 {
    let sum = p + c;
    let bits = sum.to_bits();
    let exact = sum - p == c && sum - c == p;
    if bits & 0x1fff_ffff != 0x1000_0000 || !sum.is_finite() || exact {
        return sum;
    }
    // What the sum lacks: exact, the larger magnitude first.
    let lacks = if p.abs() > c.abs() { (p - sum) + c } else { (c - sum) + p };
    f64::from_bits(if (sum < 0.0) == (lacks < 0.0) { bits + 1 } else { bits - 1 })
}

#[cfg(any(test, feature = "kernel-tests"))]
pub(super) mod tests {
    use super::*;
    use crate::kernels::testing::Random;

    #[cfg_attr(test, test)]
    pub(in crate::kernels) fn multiply_adds_round_once() {
        let mut random = Random(3);
        // Products of 24 bits and terms far below or above them, so that sums lie near ties.
        let float = |random: &mut Random| {
            let mantissa = random.bits() as u32 & [0x7f_ffff, 0x7f_f000, 0x40_0001][random.below(3)];
            f32::from_bits((random.bits() as u32 & 1) << 31 | (100 + random.below(54) as u32) << 23 | mantissa)
        };
        let mut ties = 0;
        for _ in 0..400_000 {
            let (mut a, mut b, mut c) = ([0f32; 4], [0f32; 4], [0f32; 4]);
            for i in 0..4 {
                (a[i], b[i]) = (float(&mut random), float(&mut random));
                // Half an ulp of c is the product, more or less.
                c[i] = match random.below(3) {
                    0 => float(&mut random),
                    _ => a[i] * b[i] * [1.677_721_6e7, 3.355_443_2e7][random.below(2)],
                };
                let sum = f64::from(a[i]) * f64::from(b[i]) + f64::from(c[i]);
                ties += u32::from(sum.to_bits() & 0x1fff_ffff == 0x1000_0000);
            }
            let four = |v: [f32; 4]| f32x4(v[0], v[1], v[2], v[3]);
            let got = Simd128::here().fma(four(a), four(b), four(c));
            let got = [
                f32x4_extract_lane::<0>(got),
                f32x4_extract_lane::<1>(got),
                f32x4_extract_lane::<2>(got),
                f32x4_extract_lane::<3>(got),
            ];
            for i in 0..4 {
                assert_eq!(got[i].to_bits(), a[i].mul_add(b[i], c[i]).to_bits(), "{} {} {}", a[i], b[i], c[i]);
            }
        }
        assert!(ties > 1000, "{ties} ties");
    }
}
