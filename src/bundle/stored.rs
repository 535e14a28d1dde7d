//! Weights in the scheme that a bundle stores them in.

use crate::kernels::{Kernels, Matrix, Scheme, WeightData, Weights};
use half::f16;

/// Matrices with fewer weights than this stay floats in int8 and int4 bundles, if nothing else is
/// asked for: together they are less than a hundredth of a bundle.
pub const SMALL: usize = 8192;

/// Weights of one layer in their scheme: `rows` outputs x `cols` inputs, row-major. Convolutions
/// are flattened after the first axis.
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
    /// Int8 values and a scale per row.
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

impl StoredData {
    /// The same, borrowed.
    pub fn borrow(&self) -> WeightData<'_> {
        match self {
            Self::F32(w) => WeightData::F32(w),
            Self::F16(w) => WeightData::F16(w),
            Self::I8 { q, scale } => WeightData::I8 { q, scale },
            Self::I4 { q, scale } => WeightData::I4 { q, scale },
        }
    }
}

/// Whether integer weights of layer `name` are multiplied with int16 activations rather than int8
/// ones.
///
/// Measured on the base model, the rounding of activations is nearly all that an int8 bundle loses,
/// and most of it where nothing after it evens it out: in the decoder, where every error is one of
/// the pose; in the last layer of the flow, whose error guidance multiplies; in the maps from flow
/// time, whose error all tokens share; at both ends of the encoder. The flow's transformer layers,
/// where a block's time goes, take int8.
pub fn int16_activations(name: &str) -> bool {
    let (network, layer) = name.split_once('.').unwrap_or_default();
    match network {
        "flow" | "student" => layer == "final.out" || layer.starts_with("tau.") || layer.ends_with(".mod"),
        // Steps of a thousandth of a pose go in and out of the predictors of the featherweight tier.
        "monadic" | "dyadic" => layer == "into" || layer == "out",
        "vae" => layer.starts_with("decoder.") || layer == "encoder.frame" || layer == "encoder.mu",
        _ => false,
    }
}

/// Weights packed for layer `name`, which decides on its activations.
pub(super) fn pack(kernels: Kernels, weights: Weights<'_>, name: &str, bias: Option<&[f32]>) -> Matrix {
    let matrix = kernels.pack(weights, bias).named(name);
    if int16_activations(name) { matrix.with_int16_activations() } else { matrix }
}

impl StoredWeights {
    /// Packed for layer `name`, which decides on its activations.
    pub fn pack(&self, kernels: Kernels, name: &str, bias: Option<&[f32]>) -> Matrix {
        pack(kernels, self.borrow(), name, bias)
    }

    /// The same, borrowed.
    pub fn borrow(&self) -> Weights<'_> {
        Weights { rows: self.rows, cols: self.cols, data: self.data.borrow() }
    }

    /// Their scheme.
    pub fn scheme(&self) -> Scheme {
        self.borrow().scheme()
    }

    /// The values as floats, row-major.
    pub fn to_f32(&self) -> Vec<f32> {
        self.borrow().to_f32()
    }

    /// Columns `range` of weights whose values are `floats`, packed: half floats as they are, all
    /// others as floats.
    pub(crate) fn pack_columns(
        &self,
        floats: &[f32],
        kernels: Kernels,
        range: std::ops::RangeFrom<usize>,
        bias: Option<&[f32]>,
    ) -> Matrix {
        fn cut<T: Copy>(w: &[T], cols: usize, from: usize) -> Vec<T> {
            let mut cut = Vec::with_capacity(w.len() / cols * (cols - from));
            w.chunks_exact(cols).for_each(|row| cut.extend_from_slice(&row[from..]));
            cut
        }
        let (rows, cols, from) = (self.rows, self.cols, range.start);
        let data = match &self.data {
            StoredData::F16(w) => StoredData::F16(cut(w, cols, from)),
            _ => StoredData::F32(cut(floats, cols, from)),
        };
        kernels.pack(Self { rows, cols: cols - from, data }.borrow(), bias)
    }
}
