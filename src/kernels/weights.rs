//! Plain weights, as a bundle holds them, in one of four schemes.

use super::quantize_rows::GROUP;
use crate::scheme::Scheme;
use half::f16;

/// Columns that share a scale in int4 weights.
pub const I4_GROUP: usize = GROUP;

/// Weights of a linear layer as a bundle holds them: row-major, `rows` outputs x `cols` inputs.
#[derive(Debug, Clone, Copy)]
pub struct Weights<'a> {
    /// Output features.
    pub rows: usize,
    /// Input features.
    pub cols: usize,
    /// The values and their scheme.
    pub data: WeightData<'a>,
}

/// Values of a weight matrix in one of the four schemes.
#[derive(Debug, Clone, Copy)]
pub enum WeightData<'a> {
    /// `rows * cols` floats.
    F32(&'a [f32]),
    /// `rows * cols` half floats; products and sums are in f32.
    F16(&'a [f16]),
    /// Symmetric int8: weight = `q[r][c] * scale[r]`; activations are quantised to int8 per row.
    I8 {
        /// `rows * cols` values.
        q: &'a [i8],
        /// One scale per row.
        scale: &'a [f32],
    },
    /// Group-wise int4: weight = `(n - 8) * scale[r][c / 32]`, n in 0..=15; activations are
    /// quantised to int8 per row.
    I4 {
        /// `rows * ceil(cols / 2)` bytes: column 2i in the low nibble of byte i of its row, 2i + 1
        /// in the high one.
        q: &'a [u8],
        /// `rows * ceil(cols / 32)` scales.
        scale: &'a [f16],
    },
}

/// The same bytes as int8 values.
pub(crate) fn signed(bytes: &[u8]) -> &[i8] {
    // SAFETY: u8 and i8 are of one size and alignment, and every byte is a value of both.
    unsafe { std::slice::from_raw_parts(bytes.as_ptr().cast(), bytes.len()) }
}

impl Weights<'_> {
    /// The scheme of the values.
    pub fn scheme(&self) -> Scheme {
        match self.data {
            WeightData::F32(_) => Scheme::F32,
            WeightData::F16(_) => Scheme::F16,
            WeightData::I8 { .. } => Scheme::I8,
            WeightData::I4 { .. } => Scheme::I4,
        }
    }

    /// Whether there are as many values and scales as the shape asks for.
    pub fn is_complete(&self) -> bool {
        let (r, c) = (self.rows, self.cols);
        match self.data {
            WeightData::F32(w) => w.len() == r * c,
            WeightData::F16(w) => w.len() == r * c,
            WeightData::I8 { q, scale } => q.len() == r * c && scale.len() == r,
            WeightData::I4 { q, scale } => q.len() == r * c.div_ceil(2) && scale.len() == r * c.div_ceil(I4_GROUP),
        }
    }

    /// Bytes of values and scales in a bundle.
    pub fn bytes(&self) -> usize {
        match self.data {
            WeightData::F32(w) => 4 * w.len(),
            WeightData::F16(w) => 2 * w.len(),
            WeightData::I8 { q, scale } => q.len() + 4 * scale.len(),
            WeightData::I4 { q, scale } => q.len() + 2 * scale.len(),
        }
    }

    /// The values as floats, row-major.
    pub fn to_f32(self) -> Vec<f32> {
        let cols = self.cols;
        match self.data {
            WeightData::F32(w) => w.to_vec(),
            WeightData::F16(w) => w.iter().map(|v| v.to_f32()).collect(),
            WeightData::I8 { q, scale } => {
                let mut values = Vec::with_capacity(q.len());
                for (row, scale) in q.chunks_exact(cols).zip(scale) {
                    values.extend(row.iter().map(|&v| f32::from(v) * scale));
                }
                values
            }
            WeightData::I4 { q, scale } => (0..self.rows * cols)
                .map(|i| {
                    let (row, col) = (i / cols, i % cols);
                    let nibble = (q[row * cols.div_ceil(2) + col / 2] >> (4 * (col % 2))) & 15;
                    let scale = scale[row * cols.div_ceil(I4_GROUP) + col / I4_GROUP].to_f32();
                    (f32::from(nibble) - 8.0) * scale
                })
                .collect(),
        }
    }
}
