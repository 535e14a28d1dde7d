//! Weights in the scheme that a bundle stores them in.

use crate::kernels::{Kernels, Matrix, Scheme, WeightData, Weights};
use half::f16;

/// Weights of one layer in their scheme: `rows` outputs x `cols` inputs, row-major. Convolutions are flattened after the first axis.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredWeights {
    /// Output features.
    pub rows: usize,
    /// Input features.
    pub cols: usize,
    /// The values; their number fits the shape.
    pub data: StoredData,
}

/// Values and scales; layouts as of [`WeightData`].
#[derive(Debug, Clone, PartialEq)]
pub enum StoredData {
    /// Floats.
    F32(Vec<f32>),
    /// Half floats.
    F16(Vec<f16>),
    /// Int8 values and a scale a row.
    I8 {
        /// Values.
        q: Vec<i8>,
        /// Scales.
        scale: Vec<f32>,
    },
    /// Nibbles and a scale for each 32 columns of a row.
    I4 {
        /// Two values a byte.
        q: Vec<u8>,
        /// Scales.
        scale: Vec<f16>,
    },
}

impl StoredWeights {
    /// The same, borrowed.
    pub fn borrow(&self) -> Weights<'_> {
        let data = match &self.data {
            StoredData::F32(w) => WeightData::F32(w),
            StoredData::F16(w) => WeightData::F16(w),
            StoredData::I8 { q, scale } => WeightData::I8 { q, scale },
            StoredData::I4 { q, scale } => WeightData::I4 { q, scale },
        };
        Weights { rows: self.rows, cols: self.cols, data }
    }

    /// Their scheme.
    pub fn scheme(&self) -> Scheme {
        self.borrow().scheme()
    }

    /// The values as floats, row-major.
    pub fn to_f32(&self) -> Vec<f32> {
        self.borrow().to_f32()
    }

    /// Columns `range` of float weights, packed; int8 and int4 weights are packed as floats of the same values.
    pub(crate) fn pack_columns(
        &self,
        kernels: Kernels,
        range: std::ops::RangeFrom<usize>,
        bias: Option<&[f32]>,
    ) -> Matrix {
        fn cut<T: Copy>(w: &[T], cols: usize, from: usize) -> Vec<T> {
            w.chunks_exact(cols).flat_map(|row| &row[from..]).copied().collect()
        }
        let (rows, cols, from) = (self.rows, self.cols, range.start);
        let data = match &self.data {
            StoredData::F16(w) => StoredData::F16(cut(w, cols, from)),
            _ => StoredData::F32(cut(&self.to_f32(), cols, from)),
        };
        kernels.pack(Self { rows, cols: cols - from, data }.borrow(), bias)
    }
}
