//! One pre-norm transformer layer, run over a few rows at a time with its keys and values in a ring cache.
//!
//! ```text
//! x += gate1 * proj(attend(qkv(norm1(x))))
//! x += gate2 * fc2(gelu(fc1(norm2(x))))
//! ```

use super::Phases;
use crate::kernels::{Epilogue, Exec, KvCache, Matrix, RowTable, Span};

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

/// Shift, scale and gate of both halves of a layer, one table row for each row of the pass.
///
/// Plain layer norms have their bias as the shift, their weight as the scale and no gates; AdaLN-Zero (Peebles and Xie
/// 2023) has all six, with `1 + scale` stored as the scale.
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

/// The rows of a pass: for each, the ring of layer 0 that it writes to (layer `l` writes to the `l`-th ring after it),
/// its position there, and how far back it sees.
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

    /// Adds a row at `position` of the rings from `ring` on, which sees positions `first ..= position`.
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

    /// Writes the rows' keys and values of layer `layer` to `cache`, then attends over each row's span: `qkv` is `rows x 3d`, `out`
    /// `rows x d`.
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

/// Working memory of a pass of at most `rows` rows.
#[derive(Debug)]
pub struct Scratch {
    normed: Vec<f32>,
    qkv: Vec<f32>,
    hidden: Vec<f32>,
}

impl Scratch {
    /// Memory for layers of width `width` with a feed-forward of `mlp`.
    pub fn new(rows: usize, width: usize, mlp: usize) -> Self {
        Self { normed: vec![0.0; rows * width], qkv: vec![0.0; rows * 3 * width], hidden: vec![0.0; rows * mlp] }
    }
}

/// The attention of a pass: gets a layer's number and its queries, keys and values, `rows x 3d`, and fills what each row attends to,
/// `rows x d`.
pub type Attention<'a> = dyn FnMut(&mut Exec, usize, &[f32], &mut [f32]) + 'a;

/// Runs `layers`, each with its norms, over `x` (`n x d`, in place). `attention` is [`Rows::attend`] of each of the caches that the
/// rows belong to; `then` is the layer that will probably run after the last one.
#[allow(clippy::too_many_arguments, reason = "a pass needs all of them, and they have no natural owner")]
pub fn run_layers<'a>(
    exec: &mut Exec,
    heads: usize,
    layers: impl Iterator<Item = (&'a Layer, LayerNorms<'a>)>,
    then: Option<&'a Layer>,
    phases: &Phases,
    n: usize,
    scratch: &mut Scratch,
    x: &mut [f32],
    attention: &mut Attention<'_>,
) {
    let mut layers = layers.enumerate().peekable();
    while let Some((i, (layer, norms))) = layers.next() {
        let next = layers.peek().map(|(_, (next, _))| *next).or(then);
        layer.run(exec, heads, norms, phases, n, scratch, x, |exec, qkv, out| attention(exec, i, qkv, out), next);
    }
}

impl Layer {
    /// Bytes of the packed matrices.
    pub fn bytes(&self) -> usize {
        [&self.qkv, &self.proj, &self.fc1, &self.fc2].into_iter().map(Matrix::bytes).sum()
    }

    /// Runs the layer; `next` is the one that will probably run after it.
    #[allow(clippy::too_many_arguments, reason = "a layer's pass needs all of them, and they have no natural owner")]
    fn run(
        &self,
        exec: &mut Exec,
        heads: usize,
        norms: LayerNorms<'_>,
        phases: &Phases,
        n: usize,
        scratch: &mut Scratch,
        x: &mut [f32],
        attention: impl FnOnce(&mut Exec, &[f32], &mut [f32]),
        next: Option<&Layer>,
    ) {
        let d = self.proj.out_features();
        let x = &mut x[..n * d];
        let normed = &mut scratch.normed[..n * d];
        let qkv = &mut scratch.qkv[..n * 3 * d];
        let hidden = &mut scratch.hidden[..n * self.fc1.out_features()];

        exec.norm(x, n, d, norms.norm1.0, norms.norm1.1, normed);
        exec.expect(&self.proj);
        exec.linear(&self.qkv, normed, n, qkv, Epilogue::Store);
        let half = n * d / heads / 2;
        exec.rope(qkv, n, 3 * d, 2 * heads, d / heads, &phases.cos[..half], &phases.sin[..half]);
        attention(exec, qkv, normed);
        exec.expect(&self.fc1);
        exec.linear(&self.proj, normed, n, x, gated(norms.gate1));

        exec.norm(x, n, d, norms.norm2.0, norms.norm2.1, normed);
        exec.expect(&self.fc2);
        exec.linear(&self.fc1, normed, n, hidden, Epilogue::Gelu);
        if let Some(next) = next {
            exec.expect(&next.qkv);
        }
        exec.linear(&self.fc2, hidden, n, x, gated(norms.gate2));
    }
}

fn gated(gate: Option<RowTable<'_>>) -> Epilogue<'_> {
    gate.map_or(Epilogue::Add, Epilogue::GatedAdd)
}
