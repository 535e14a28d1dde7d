//! A pre-norm transformer layer's weights, and where the rows of a pass stand in their ring caches.
//!
//! ```text
//! x += gate1 * proj(attend(qkv(norm1(x))))
//! x += gate2 * fc2(gelu(fc1(norm2(x))))
//! ```

use crate::kernels::{Exec, KvCache, Matrix, Span};

/// Weights of a layer of width `d`.
#[derive(Debug)]
pub struct Layer {
    /// Queries, keys and values: `[3d, d]`.
    pub qkv: Matrix,
    /// Output projection of the attention: `[d, d]`.
    pub proj: Matrix,
    /// First feed-forward matrix: `[mlp, d]`.
    pub fc1: Matrix,
    /// Second feed-forward matrix: `[d, mlp]`.
    pub fc2: Matrix,
}

impl Layer {
    /// Bytes of the packed matrices.
    pub fn bytes(&self) -> usize {
        [&self.qkv, &self.proj, &self.fc1, &self.fc2].into_iter().map(Matrix::bytes).sum()
    }
}

/// One sequence's rows of a pass: for each, the ring of layer 0 that it writes to (layer `l` writes
/// to the `l`-th ring after it), its position there, and how far back it sees.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    base: Vec<u32>,
    spans: Vec<Span>,
    positions: Vec<u64>,
}

impl Rows {
    /// Room for `rows` rows.
    pub fn with_capacity(rows: usize) -> Self {
        Self { base: Vec::with_capacity(rows), spans: Vec::with_capacity(rows), positions: Vec::with_capacity(rows) }
    }

    /// No rows, room kept.
    pub fn clear(&mut self) {
        self.base.clear();
        self.spans.clear();
        self.positions.clear();
    }

    /// Adds a row at `position` of the rings from `ring` on, which sees positions `first ..=
    /// position`.
    pub fn push(&mut self, ring: usize, position: u64, first: u64) {
        debug_assert!(first <= position && self.base.len() < self.base.capacity());
        self.base.push(ring as u32);
        self.positions.push(position);
        self.spans.push(Span { ring: ring as u32, first, len: (position - first + 1) as u32 });
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.base.len()
    }

    /// Writes the rows' keys and values of layer `layer` to `cache`, then attends over each row's
    /// span: `qkv` is `rows x 3d`, `out` `rows x d`.
    pub fn attend(&mut self, exec: &mut Exec, layer: usize, cache: &mut KvCache, qkv: &[f32], out: &mut [f32]) {
        let d = cache.dim();
        let base = self.base.iter().zip(&self.positions).zip(qkv.chunks_exact(3 * d));
        for (span, ((base, position), row)) in self.spans.iter_mut().zip(base) {
            span.ring = base + layer as u32;
            cache.write(span.ring as usize, *position, &row[d..2 * d], &row[2 * d..]);
        }
        exec.attend(qkv, 3 * d, cache, &self.spans, out);
    }
}
