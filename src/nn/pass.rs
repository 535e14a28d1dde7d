//! A pass: rows that go through a network's layers together, and the memory that this takes.
//!
//! A row's results depend on that row and on the cache that it attends to alone, bit for bit,
//! whatever other rows are in the pass.

use super::{Layer, Phases, Rope};
use crate::kernels::{Epilogue, Exec, Matrix, RowTable};
use std::ops::Range;

/// Shift, scale and gate of both halves of a layer, one table row for each row of the pass.
///
/// Plain layer norms have their bias as the shift, their weight as the scale and no gates;
/// AdaLN-Zero (Peebles and Xie 2023) has all six, with `1 + scale` stored as the scale.
#[derive(Clone, Copy)]
pub struct LayerNorms<'a> {
    /// Shift and scale before the attention.
    pub norm1: (RowTable<'a>, RowTable<'a>),
    /// Gate of the attention.
    pub gate1: Option<RowTable<'a>>,
    /// Shift and scale before the feed-forward.
    pub norm2: (RowTable<'a>, RowTable<'a>),
    /// Gate of the feed-forward.
    pub gate2: Option<RowTable<'a>>,
}

/// The norms of a network; `index` holds the number of the table row that each row of the pass
/// uses.
pub trait Norms {
    /// Those of layer `layer`.
    fn layer<'a>(&'a self, layer: usize, index: &'a [u32]) -> LayerNorms<'a>;

    /// Shift and scale of the norm after the last layer.
    fn last<'a>(&'a self, index: &'a [u32]) -> (RowTable<'a>, RowTable<'a>);
}

/// The attention of a pass: gets a layer's number and its queries, keys and values, `rows x 3
/// width`, and fills what each row attends to, `rows x width`: [`super::Rows::attend`] of each of
/// the caches that the rows belong to.
pub type Attention<'a> = dyn FnMut(&mut Exec, usize, &[f32], &mut [f32]) + 'a;

/// Sizes of a network's layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Channels of a row.
    pub width: usize,
    /// Heads of the attention.
    pub heads: usize,
    /// Width of the feed-forward.
    pub hidden: usize,
}

/// Rows on their way through a network.
///
/// ```text
/// clear -> push (a row each) -> run -> read (the rows that are wanted) -> project
/// ```
#[derive(Debug)]
pub struct Pass {
    sizes: Sizes,
    rows: usize,
    /// Table row of the norms, of each row.
    index: Vec<u32>,
    phases: Phases,
    x: Vec<f32>,
    /// Normed rows: the layers' input, and after them the rows that were read.
    normed: Vec<f32>,
    read: usize,
    qkv: Vec<f32>,
    hidden: Vec<f32>,
}

impl Pass {
    /// Memory for up to `rows` rows.
    pub fn new(sizes: Sizes, rows: usize, rope: &Rope) -> Self {
        let Sizes { width, hidden, .. } = sizes;
        Self {
            sizes,
            rows: 0,
            index: Vec::with_capacity(rows),
            phases: rope.phases(rows),
            x: vec![0.0; rows * width],
            normed: vec![0.0; rows * width],
            read: 0,
            qkv: vec![0.0; rows * 3 * width],
            hidden: vec![0.0; rows * hidden],
        }
    }

    /// No rows, memory kept.
    pub fn clear(&mut self) {
        (self.rows, self.read) = (0, 0);
        self.index.clear();
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds a row at `position` of its sequence with norms of table row `norms`, and hands out its
    /// input to be filled, `[width]`.
    ///
    /// # Panics
    /// When there is no room.
    pub fn push(&mut self, rope: &Rope, position: u64, norms: u32) -> &mut [f32] {
        let row = self.rows;
        debug_assert!(row < self.index.capacity(), "a pass allocates when it is made");
        rope.fill(&mut self.phases, row, position);
        self.index.push(norms);
        self.rows += 1;
        self.input(row..row + 1)
    }

    /// The input of rows `rows`.
    pub fn input(&mut self, rows: Range<usize>) -> &mut [f32] {
        &mut self.x[rows.start * self.sizes.width..rows.end * self.sizes.width]
    }

    /// Runs all rows through `layers`; `then` is the layer that will probably run after the last
    /// one.
    pub fn run(
        &mut self,
        exec: &mut Exec,
        layers: &[Layer],
        norms: &impl Norms,
        then: Option<&Layer>,
        attention: &mut Attention<'_>,
    ) {
        let Sizes { width, heads, hidden } = self.sizes;
        let n = self.rows;
        let half = n * width / heads / 2;
        let (cos, sin) = (&self.phases.cos[..half], &self.phases.sin[..half]);
        let (x, normed) = (&mut self.x[..n * width], &mut self.normed[..n * width]);
        let (qkv, hidden) = (&mut self.qkv[..n * 3 * width], &mut self.hidden[..n * hidden]);
        for (i, layer) in layers.iter().enumerate() {
            let norms = norms.layer(i, &self.index);
            let gated = |gate: Option<_>| gate.map_or(Epilogue::Add, Epilogue::GatedAdd);

            exec.norm(x, n, width, norms.norm1.0, norms.norm1.1, normed);
            exec.expect(&layer.proj);
            exec.linear(&layer.qkv, normed, n, qkv, Epilogue::Store);
            exec.rope(qkv, n, 3 * width, 2 * heads, width / heads, cos, sin);
            attention(exec, i, qkv, normed);
            exec.expect(&layer.fc1);
            exec.linear(&layer.proj, normed, n, x, gated(norms.gate1));

            exec.norm(x, n, width, norms.norm2.0, norms.norm2.1, normed);
            exec.expect(&layer.fc2);
            exec.linear(&layer.fc1, normed, n, hidden, Epilogue::Gelu);
            if let Some(next) = layers.get(i + 1).or(then) {
                exec.expect(&next.qkv);
            }
            exec.linear(&layer.fc2, hidden, n, x, gated(norms.gate2));
        }
    }

    /// Puts the final norm of rows `rows`, which have run, after the rows that were read before.
    pub fn read(&mut self, exec: &mut Exec, norms: &impl Norms, rows: Range<usize>) {
        let (width, n) = (self.sizes.width, rows.len());
        let (shift, scale) = norms.last(&self.index[rows.clone()]);
        let out = &mut self.normed[self.read * width..][..n * width];
        exec.norm(&self.x[rows.start * width..rows.end * width], n, width, shift, scale, out);
        self.read += n;
    }

    /// The rows that were read, multiplied by `matrix`: `out` is `read rows x outputs`, returned as
    /// far as it was filled.
    pub fn project<'o>(&self, exec: &mut Exec, matrix: &Matrix, out: &'o mut [f32]) -> &'o [f32] {
        let out = &mut out[..self.read * matrix.out_features()];
        exec.linear(matrix, &self.normed[..self.read * self.sizes.width], self.read, out, Epilogue::Store);
        out
    }
}
