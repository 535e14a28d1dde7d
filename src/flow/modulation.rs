//! Modulation vectors of flow times (AdaLN-Zero; Peebles and Xie 2023): they depend on the flow
//! time alone, so they are tabulated and `6 d^2` weights per layer stay out of the hot path.

use crate::bundle::Tensors;
use crate::config::FlowConfig;
use crate::error::{Error, ErrorKind, Result};
use crate::kernels::{Epilogue, Exec, Kernels, Matrix, RowTable};
use crate::nn::{LayerNorms, Norms};
use std::sync::Arc;

/// Where a network gets its modulation from; used when sessions start, never in a block.
#[derive(Debug)]
pub(super) enum Modulator {
    /// The weights: any flow time.
    Weights(Box<TauWeights>),
    /// A table that was made of them when they were loaded: its flow times and no others.
    Table(Arc<Modulation>),
}

/// What turns a flow time into modulation vectors.
#[derive(Debug)]
pub(super) struct TauWeights {
    first: Matrix,
    second: Matrix,
    layers: Vec<Matrix>,
    last: Matrix,
}

/// AdaLN-Zero shift, scale and gate of every layer for a list of flow times.
///
/// One row of the table per flow time: six vectors per layer (shift, 1 + scale, gate of the
/// attention, then of the feed-forward), then the final shift and 1 + scale.
#[derive(Debug)]
pub struct Modulation {
    times: Vec<f32>,
    table: Vec<f32>,
    width: usize,
    layers: usize,
}

impl Modulator {
    /// Reads the weights of `{prefix}.*`; with `times` they make way for a table of those.
    pub(super) fn load(
        t: &Tensors<'_>,
        kernels: Kernels,
        c: &FlowConfig,
        prefix: &str,
        times: Option<&[f32]>,
    ) -> Result<Self> {
        let (d, width) = (c.width, c.tau_width);
        let linear = |part: &str, outputs| t.linear(kernels, &format!("{prefix}.{part}"), outputs, &[width]);
        let layers = (0..c.layers).map(|i| linear(&format!("layers.{i}.mod"), 6 * d));
        let weights = TauWeights {
            first: linear("tau.0", width)?,
            second: linear("tau.2", width)?,
            layers: layers.collect::<Result<_>>()?,
            last: linear("final.mod", 2 * d)?,
        };
        let Some(times) = times else { return Ok(Self::Weights(Box::new(weights))) };
        let mut exec = Exec::new(kernels, 1, width)?;
        // As where sessions tabulate: denormals are zero.
        exec.begin();
        let table = weights.tabulate(&mut exec, c, times);
        exec.end();
        Ok(Self::Table(Arc::new(table)))
    }

    /// Modulation of the given flow times.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where there is a table, of other times.
    pub(super) fn modulation(&self, exec: &mut Exec, c: &FlowConfig, times: &[f32]) -> Result<Arc<Modulation>> {
        match self {
            Self::Weights(weights) => Ok(Arc::new(weights.tabulate(exec, c, times))),
            Self::Table(table) if table.times == times => Ok(Arc::clone(table)),
            Self::Table(_) => Err(Error::new(
                ErrorKind::Argument,
                "this engine was loaded without the modulation weights, so it has the bundle's flow times alone: use midpoint, Euler with 1, 2, 4 \
                 or 8 steps or the single step, and the bundle's history time; or load all networks",
            )),
        }
    }

    /// Bytes of the packed matrices, or of the table.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Weights(w) => [&w.first, &w.second, &w.last].into_iter().chain(&w.layers).map(Matrix::bytes).sum(),
            Self::Table(table) => size_of_val(table.table.as_slice()),
        }
    }
}

impl TauWeights {
    fn tabulate(&self, exec: &mut Exec, c: &FlowConfig, times: &[f32]) -> Modulation {
        let (d, layers, width, n) = (c.width, c.layers, c.tau_width, times.len());
        let mut this = Modulation { times: times.to_vec(), table: Vec::new(), width: d, layers };
        this.table.resize(n * this.stride(), 0.0);
        let (mut a, mut b) = (vec![0.0; n * width], vec![0.0; n * width]);
        times.iter().zip(a.chunks_exact_mut(width)).for_each(|(time, a)| sinusoids(*time, a));
        exec.linear(&self.first, &a, n, &mut b, Epilogue::Store);
        exec.silu(&mut b);
        exec.linear(&self.second, &b, n, &mut a, Epilogue::Store);
        exec.silu(&mut a);
        let mut vectors = vec![0.0; n * 6 * d];
        for (l, matrix) in self.layers.iter().chain([&self.last]).enumerate() {
            let out = matrix.out_features();
            let vectors = &mut vectors[..n * out];
            exec.linear(matrix, &a, n, vectors, Epilogue::Store);
            let stride = this.stride();
            for (row, vectors) in this.table.chunks_exact_mut(stride).zip(vectors.chunks_exact(out)) {
                let row = &mut row[l * 6 * d..][..out];
                row.copy_from_slice(vectors);
                // The second of three is the scale, and of the last two.
                row.chunks_exact_mut(d).skip(1).step_by(3).flatten().for_each(|scale| *scale += 1.0);
            }
        }
        this
    }
}

impl Modulation {
    fn stride(&self) -> usize {
        self.layers * 6 * self.width + 2 * self.width
    }

    fn rows<'a>(&'a self, vector: usize, index: &'a [u32]) -> RowTable<'a> {
        RowTable { table: &self.table, stride: self.stride(), offset: vector * self.width, index }
    }
}

impl Norms for Modulation {
    fn layer<'a>(&'a self, layer: usize, index: &'a [u32]) -> LayerNorms<'a> {
        let v = |i| self.rows(layer * 6 + i, index);
        LayerNorms { norm1: (v(0), v(1)), gate1: Some(v(2)), norm2: (v(3), v(4)), gate2: Some(v(5)) }
    }

    fn last<'a>(&'a self, index: &'a [u32]) -> (RowTable<'a>, RowTable<'a>) {
        (self.rows(self.layers * 6, index), self.rows(self.layers * 6 + 1, index))
    }
}

/// Embedding of a flow time: cosines then sines of `1000 tau` at frequencies `10000^(-i / half)`.
fn sinusoids(tau: f32, out: &mut [f32]) {
    let half = out.len() / 2;
    for i in 0..half {
        let angle = 1000.0 * f64::from(tau) * libm::pow(10_000.0, -(i as f64) / half as f64);
        out[i] = libm::cos(angle) as f32;
        out[half + i] = libm::sin(angle) as f32;
    }
}
