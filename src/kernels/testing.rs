//! What the operations' tests share: random numbers, awkward values, and the variants that this CPU can run.

use super::{Kernels, Variant};

/// SplitMix64 (Steele, Lea and Flood 2014): small, seeded, good enough for test data.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In `0..n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// In -1..1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    pub(crate) fn floats(&mut self, n: usize, scale: f32) -> Vec<f32> {
        (0..n).map(|_| self.unit() * scale).collect()
    }

    /// Floats among which about one in eight is zero, denormal, tiny, huge or negative zero.
    pub(crate) fn awkward(&mut self, n: usize) -> Vec<f32> {
        const ODD: [f32; 8] = [0.0, -0.0, 1e-40, -1e-40, 1e-20, 1e15, -1e15, f32::MIN_POSITIVE];
        (0..n).map(|_| if self.below(8) == 0 { ODD[self.below(8)] } else { self.unit() }).collect()
    }

    pub(crate) fn bytes(&mut self, n: usize) -> Vec<i8> {
        (0..n).map(|_| self.bits() as i8).collect()
    }
}

/// The entries of a table that this CPU can run, the scalar reference among them.
pub(crate) fn available<F>(table: &'static [Variant<F>]) -> impl Iterator<Item = &'static Variant<F>> {
    assert_eq!(table[0].name, "scalar", "the reference comes first");
    table.iter().filter(|v| v.level.is_available())
}

/// Kernels of each available level.
pub(crate) fn levels() -> impl Iterator<Item = Kernels> {
    Kernels::available().into_iter().map(|l| Kernels::with_level(l).expect("listed as available"))
}

pub(crate) fn bits(v: &[f32]) -> Vec<u32> {
    v.iter().map(|v| v.to_bits()).collect()
}

/// Calls `check` with rows of all tails and of magnitudes up to a size, which it is told, unaligned; a quarter of them with a value that is not finite, or 0.
pub(crate) fn for_rows_of_all_sizes(seed: u64, check: impl Fn(&[f32], f32)) {
    let mut random = Random(seed);
    for n in (0..140).chain([1024, 4096]) {
        for size in [1e-38, 1e-31, 1e-29, 1.0, 3e38] {
            let mut x = random.floats(n + 1, size);
            if n > 0 && random.below(4) == 0 {
                x[1 + random.below(n)] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0][random.below(4)];
            }
            check(&x[1..], size);
        }
    }
}
