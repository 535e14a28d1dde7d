//! Standard normal noise as a pure function of (seed, token, channel).
//!
//! Philox4x32-10 (Salmon et al. 2011) turns a counter into 128 random bits; Box-Muller turns them
//! into normals. The arithmetic is f64 from `libm`, so every platform gets the same bits.

/// Fills `out` with the noise of token `token` under `seed`.
pub fn normal(seed: u64, token: u64, out: &mut [f32]) {
    for (block, chunk) in out.chunks_mut(4).enumerate() {
        let counter = [token as u32, (token >> 32) as u32, block as u32, 0];
        let bits = philox(counter, [seed as u32, (seed >> 32) as u32]);
        let (a, b) = box_muller(bits[0], bits[1]);
        let (c, d) = box_muller(bits[2], bits[3]);
        for (o, v) in chunk.iter_mut().zip([a, b, c, d]) {
            *o = v;
        }
    }
}

/// Two independent numbers in [0, 1) of index `index` under `seed`; no noise of a token comes from
/// the same counter.
pub fn uniform(seed: u64, index: u64) -> [f32; 2] {
    let bits = philox([index as u32, (index >> 32) as u32, 0, 1], [seed as u32, (seed >> 32) as u32]);
    [bits[0], bits[1]].map(|b| (b >> 8) as f32 / (1 << 24) as f32)
}

fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let a = u64::from(counter[0]) * 0xD251_1F53;
        let b = u64::from(counter[2]) * 0xCD9E_8D57;
        counter = [(b >> 32) as u32 ^ counter[1] ^ key[0], b as u32, (a >> 32) as u32 ^ counter[3] ^ key[1], a as u32];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

/// Two independent normals from two words; the first word is mapped to (0, 1], so the logarithm is
/// finite.
fn box_muller(a: u32, b: u32) -> (f32, f32) {
    const STEP: f64 = 1.0 / 4_294_967_296.0;
    let radius = libm::sqrt(-2.0 * libm::log((f64::from(a) + 1.0) * STEP));
    let angle = std::f64::consts::TAU * f64::from(b) * STEP;
    ((radius * libm::cos(angle)) as f32, (radius * libm::sin(angle)) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_known_answers() {
        // Published test vectors of Philox4x32-10.
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let counter = [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344];
        let key = [0xa409_3822, 0x299f_31d0];
        assert_eq!(philox(counter, key), [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]);
    }

    #[test]
    fn moments_are_normal() {
        let mut values = vec![0f32; 64];
        let (mut n, mut sum, mut squares, mut fourth) = (0.0, 0.0, 0.0, 0.0);
        for token in 0..2000 {
            normal(7, token, &mut values);
            for v in values.iter().map(|v| f64::from(*v)) {
                n += 1.0;
                sum += v;
                squares += v * v;
                fourth += v.powi(4);
            }
        }
        assert!((sum / n).abs() < 0.01, "mean {}", sum / n);
        assert!((squares / n - 1.0).abs() < 0.02, "variance {}", squares / n);
        assert!((fourth / n - 3.0).abs() < 0.15, "fourth moment {}", fourth / n);
    }

    #[test]
    fn length_does_not_change_values_and_seeds_do() {
        let (mut long, mut short, mut other) = (vec![0f32; 32], vec![0f32; 13], vec![0f32; 32]);
        normal(1, u64::MAX - 3, &mut long);
        normal(1, u64::MAX - 3, &mut short);
        normal(2, u64::MAX - 3, &mut other);
        assert_eq!(long[..13], short[..]);
        assert_ne!(long, other);
    }
}
