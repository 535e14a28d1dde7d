//! Elementary functions and reductions that every level computes with the same bits.
//!
//! Written on scalars and 16-lane arrays without branches, and inlined into functions that are
//! compiled for one level each, where the compiler turns the lanes into vectors. Only IEEE
//! operations and fused multiply-adds are used.

/// Lanes of every reduction.
pub(crate) const LANES: usize = 16;

/// Partial sums or products of one reduction.
pub(crate) type Lanes = [f32; LANES];

/// Sum of the lanes, folded by halves: l + (l+8), then +4, +2, +1.
#[inline(always)]
pub(crate) fn fold(mut v: Lanes) -> f32 {
    for half in [8, 4, 2, 1] {
        for i in 0..half {
            v[i] += v[i + half];
        }
    }
    v[0]
}

/// Rounds to nearest even by its own rounding error: for |x| < 2^22, x + MAGIC holds the integer in
/// its low bits.
pub(crate) const MAGIC: f32 = 12_582_912.0;
pub(crate) const LN2_HI: f32 = 0.693_359_4;
pub(crate) const LN2_LO: f32 = -2.121_944_4e-4;
pub(crate) const EXP_LOW: f32 = -87.0;
pub(crate) const EXP_HIGH: f32 = 88.0;
/// Of the Taylor polynomial, highest power first.
pub(crate) const EXP_COEFFICIENTS: [f32; 8] =
    [1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0];

/// e^x with relative error below 2e-7 for x in [-87, 88]; clamped outside to e^-87 and e^88; NaN
/// stays NaN.
///
/// x = n ln 2 + r with |r| <= ln 2 / 2, and the Taylor polynomial of degree 7 in r, whose remainder
/// is below 6e-9.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    let x = if x < EXP_LOW { EXP_LOW } else { x };
    let x = if x > EXP_HIGH { EXP_HIGH } else { x };
    let t = x.mul_add(std::f32::consts::LOG2_E, MAGIC);
    let n = t - MAGIC;
    let r = n.mul_add(-LN2_LO, n.mul_add(-LN2_HI, x));
    let mut p = EXP_COEFFICIENTS[0];
    for c in &EXP_COEFFICIENTS[1..] {
        p = r.mul_add(p, *c);
    }
    p * f32::from_bits((t.to_bits() << 23).wrapping_add(0x3f80_0000))
}

/// x / (1 + e^-x).
#[inline(always)]
pub(crate) fn silu(x: f32) -> f32 {
    x / (1.0 + exp(-x))
}

/// 1 / (1 + e^-x), relative error below 4e-7 for |x| < 80.
#[inline(always)]
pub(crate) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// tanh x as 2 sigmoid(2x) - 1: absolute error below 3e-7; 0 at 0, and 1 where that is nearest.
#[inline(always)]
pub(crate) fn tanh(x: f32) -> f32 {
    2.0 / (1.0 + exp(-2.0 * x)) - 1.0
}

/// -2 sqrt(2/pi), and times the cubic term's weight.
pub(crate) const GELU_A: f32 = -2.0 * 0.797_884_6;
pub(crate) const GELU_B: f32 = 0.044_715 * GELU_A;

/// GELU in its tanh form, 0.5 x (1 + tanh(sqrt(2/pi) (x + 0.044715 x^3))), as x / (1 + e^(-2u))
/// with u the argument of tanh.
#[inline(always)]
pub(crate) fn gelu(x: f32) -> f32 {
    let e = exp(x * (x * x).mul_add(GELU_B, GELU_A));
    x / (1.0 + e)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_match_f64() {
        let mut worst = [0.0f64; 5];
        for i in -440_000..440_000 {
            let x = i as f32 * 1.97e-4;
            let rel = |got: f32, want: f64| (f64::from(got) - want).abs() / want.abs().max(1e-30);
            let d = f64::from(x);
            worst[0] = worst[0].max(rel(exp(x), d.exp()));
            let near = x.abs() < 9.0;
            worst[1] = worst[1].max(if near { rel(silu(x), d / (1.0 + (-d).exp())) } else { 0.0 });
            let u = (2.0 / std::f64::consts::PI).sqrt() * (d + 0.044715 * d * d * d);
            worst[3] = worst[3].max(if x.abs() < 80.0 { rel(sigmoid(x), 1.0 / (1.0 + (-d).exp())) } else { 0.0 });
            worst[4] = worst[4].max((f64::from(tanh(x)) - d.tanh()).abs());
            let tail = if x.abs() < 3.0 { 1.0 } else { 0.1 };
            worst[2] = worst[2].max(if near { tail * rel(gelu(x), d / (1.0 + (-2.0 * u).exp())) } else { 0.0 });
        }
        assert!(worst[0] < 2e-7 && worst[1] < 4e-7 && worst[2] < 2e-6, "{worst:?}");
        assert!(worst[3] < 4e-7 && worst[4] < 3e-7, "{worst:?}");
    }

    #[test]
    fn extremes() {
        assert!(exp(f32::NAN).is_nan() && gelu(f32::NAN).is_nan() && silu(f32::NAN).is_nan());
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(-1e30) < 2e-38 && exp(1e30).is_finite());
        assert!(sigmoid(f32::NAN).is_nan() && tanh(f32::NAN).is_nan());
        assert_eq!([tanh(0.0), tanh(50.0), tanh(-50.0), sigmoid(0.0)], [0.0, 1.0, -1.0, 0.5]);
        assert_eq!(gelu(100.0), 100.0);
        assert_eq!(gelu(0.0), 0.0);
        assert!(gelu(-100.0).abs() < 1e-30 && silu(-100.0).abs() < 1e-30);
    }
}
