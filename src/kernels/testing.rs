//! What the operations' tests share: random numbers, awkward values, and the variants that this CPU
//! can run.

use std::fmt::Display;
use std::hash::{DefaultHasher, Hash, Hasher};

use super::operation::{Kernel, Operation};
use super::{Kernels, Level};

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

/// Results of one variant, case by case: kept of the scalar one, compared of the others.
pub(crate) struct Results {
    level: Level,
    expected: Vec<u64>,
    cases: usize,
}

impl Results {
    /// The results of one case, as bits; `case` describes it.
    pub(crate) fn add(&mut self, case: impl Display, bits: impl IntoIterator<Item = u32>) {
        let mut hasher = DefaultHasher::new();
        bits.into_iter().for_each(|bits| bits.hash(&mut hasher));
        if self.level == Level::Scalar {
            self.expected.push(hasher.finish());
        } else {
            let expected = self.expected.get(self.cases).copied();
            assert_eq!(expected, Some(hasher.finish()), "{} has other bits than the reference: {case}", self.level);
        }
        self.cases += 1;
    }
}

/// What was found to agree.
#[derive(Debug)]
pub struct Agreement {
    /// The levels that have a variant here.
    pub levels: Vec<Level>,
    /// How many cases each of them was run on.
    pub cases: usize,
    /// Of the bits of all results, the same on every machine.
    pub digest: u64,
}

/// That every variant that this CPU can run has the bits of the scalar one in `cases`, which runs
/// the kernel that it is given and records what comes out, the same cases for each.
pub(crate) fn agree<O: Operation>(cases: impl Fn(Kernel<O>, &mut Results)) -> Agreement {
    let mut results = Results { level: Level::Scalar, expected: Vec::new(), cases: 0 };
    cases(Kernel::reference(), &mut results);
    assert!(results.cases > 0, "there are cases");
    let mut levels = vec![Level::Scalar];
    for kernel in Kernel::<O>::all().filter(|k| k.level() != Level::Scalar) {
        (results.level, results.cases) = (kernel.level(), 0);
        cases(kernel, &mut results);
        assert_eq!(results.cases, results.expected.len(), "{}: the same cases for each variant", kernel.level());
        levels.push(kernel.level());
    }
    let mut hasher = DefaultHasher::new();
    results.expected.iter().for_each(|case| case.hash(&mut hasher));
    Agreement { levels, cases: results.expected.len(), digest: hasher.finish() }
}

impl std::fmt::Display for Agreement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let levels = self.levels.iter().map(|l| l.name()).collect::<Vec<_>>().join(",");
        write!(f, "{:016x} {} {levels}", self.digest, self.cases)
    }
}

/// Kernels of each available level.
pub(crate) fn levels() -> impl Iterator<Item = Kernels> {
    Kernels::available().into_iter().map(|l| Kernels::with_level(l).expect("listed as available"))
}

/// The bits of floats, one NaN like any other: which one an operation gives is the CPU's choice.
pub(crate) fn bits(v: &[f32]) -> Vec<u32> {
    v.iter().map(|v| if v.is_nan() { f32::NAN.to_bits() } else { v.to_bits() }).collect()
}

/// `web/kernels_check.sh` holds these against WebAssembly's.
#[test]
#[ignore = "prints the digest of each operation's results"]
fn digests() {
    for (name, check) in super::agreements() {
        println!("{name} {}", check());
    }
}

/// Calls `check` with rows of all tails and of magnitudes up to a size, which it is told,
/// unaligned; a quarter of them with a value that is not finite, or 0.
pub(crate) fn for_rows_of_all_sizes(seed: u64, mut check: impl FnMut(&[f32], f32)) {
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
