//! Layer norms with weights of their own.

use super::{LayerNorms, Norms};
use crate::kernels::RowTable;

/// Layer norms of a network: every row uses the one row of its norm's table.
#[derive(Debug)]
pub struct PlainNorms {
    /// Before the attention and before the feed-forward of each layer.
    pub layers: Vec<[Affine; 2]>,
    /// After the last layer.
    pub last: Affine,
}

/// Bias then weight of a layer norm.
#[derive(Debug)]
pub struct Affine(Vec<f32>);

impl Affine {
    /// Of `bias` and `weight`, `[d]` each.
    pub fn new(bias: &[f32], weight: &[f32]) -> Self {
        Self([bias, weight].concat())
    }

    /// Shift (bias) and scale (weight) for the rows in `index`.
    fn tables<'a>(&'a self, index: &'a [u32]) -> (RowTable<'a>, RowTable<'a>) {
        let d = self.0.len() / 2;
        let table = |offset| RowTable { table: &self.0, stride: 2 * d, offset, index };
        (table(0), table(d))
    }
}

impl Norms for PlainNorms {
    fn layer<'a>(&'a self, layer: usize, index: &'a [u32]) -> LayerNorms<'a> {
        let [norm1, norm2] = &self.layers[layer];
        LayerNorms { norm1: norm1.tables(index), gate1: None, norm2: norm2.tables(index), gate2: None }
    }

    fn last<'a>(&'a self, index: &'a [u32]) -> (RowTable<'a>, RowTable<'a>) {
        self.last.tables(index)
    }
}
