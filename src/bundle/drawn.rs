//! Tensors that are drawn from their names instead of read: networks of sizes for which there is no
//! bundle, to measure their speed.

use super::{IDLE_LATENTS, SMALL, StoredData, StoredWeights};
use crate::frame::BLOCK_FRAMES;
use crate::kernels::{I4_GROUP, Scheme};
use half::f16;

/// Rows of a matrix that may have any number: an idle clip of two blocks, a row a frame, or a block
/// as latents.
pub(super) fn rows(name: &str) -> usize {
    if name == IDLE_LATENTS { 2 } else { 2 * BLOCK_FRAMES }
}

/// A stream of numbers that depends on a name alone.
struct Source(u64);

impl Source {
    /// FNV-1a of the name, then a xorshift.
    fn new(name: &str) -> Self {
        let hash = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        Self(name.bytes().fold(0xcbf2_9ce4_8422_2325, hash) | 1)
    }

    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// In -1..1.
    fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn bytes<T>(&mut self, n: usize, value: impl Fn(u8) -> T) -> Vec<T> {
        let mut bytes = Vec::with_capacity(n.next_multiple_of(8));
        while bytes.len() < n {
            bytes.extend(self.bits().to_le_bytes().map(&value));
        }
        bytes.truncate(n);
        bytes
    }
}

/// Standard deviations are 1, others spread evenly around 0 within one over the root of the row's
/// length.
pub(super) fn floats(name: &str, shape: &[usize]) -> Vec<f32> {
    let count = shape.iter().product();
    if name.ends_with("_std") {
        return vec![1.0; count];
    }
    let mut source = Source::new(name);
    let scale = reach(shape.last().copied().unwrap_or(1));
    (0..count).map(|_| scale * source.unit()).collect()
}

/// Weights of the same spread, drawn in their scheme; matrices that are too small to be quantised
/// are half floats, as in bundles.
pub(super) fn weights(name: &str, rows: usize, cols: usize, scheme: Scheme) -> StoredWeights {
    let mut source = Source::new(name);
    let scheme = match scheme {
        Scheme::I8 | Scheme::I4 if rows * cols < SMALL => Scheme::F16,
        scheme => scheme,
    };
    let data = match scheme {
        Scheme::F32 => StoredData::F32(floats(name, &[rows, cols])),
        Scheme::F16 => StoredData::F16((0..rows * cols).map(|_| f16::from_f32(reach(cols) * source.unit())).collect()),
        Scheme::I8 => StoredData::I8 {
            q: source.bytes(rows * cols, |b| (b as i8).max(-127)),
            scale: vec![reach(cols) / 127.0; rows],
        },
        Scheme::I4 => StoredData::I4 {
            q: source.bytes(rows * cols.div_ceil(2), |b| b),
            scale: vec![f16::from_f32(reach(cols) / 8.0); rows * cols.div_ceil(I4_GROUP)],
        },
    };
    StoredWeights { rows, cols, data }
}

fn reach(cols: usize) -> f32 {
    1.0 / (cols.max(1) as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_every_scheme_have_the_same_spread() {
        let (rows, cols) = (96, 200);
        for scheme in [Scheme::F32, Scheme::F16, Scheme::I8, Scheme::I4] {
            let drawn = weights("a", rows, cols, scheme);
            assert_eq!(drawn.scheme(), scheme);
            assert_eq!(drawn, weights("a", rows, cols, scheme), "a name has its numbers");
            assert_ne!(drawn, weights("b", rows, cols, scheme));
            let values = drawn.to_f32();
            let power = values.iter().map(|v| f64::from(v * v)).sum::<f64>() / values.len() as f64 * cols as f64;
            assert!((power - 1.0 / 3.0).abs() < 0.02, "{scheme}: {power}");
        }
        assert_eq!(weights("a", 10, 10, Scheme::I8).scheme(), Scheme::F16);
    }
}
