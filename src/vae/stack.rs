//! The transformer stack that encoder and decoder share: plain layer norms, one ring a layer.

use crate::bundle::Tensors;
use crate::config::VaeConfig;
use crate::error::Result;
use crate::kernels::{Exec, Kernels, KvCache, KvDtype, RowTable};
use crate::nn::{Attention, Layer, LayerNorms, Phases, Rope, Rows, Scratch, run_layers};

/// Weights of a stack of layers and its final norm.
#[derive(Debug)]
pub(super) struct Stack {
    config: VaeConfig,
    tokens: usize,
    layers: Vec<(Layer, Norms)>,
    final_norm: Affine,
    rope: Rope,
}

#[derive(Debug)]
struct Norms {
    ln1: Affine,
    ln2: Affine,
}

/// Bias then weight of a layer norm.
#[derive(Debug)]
struct Affine(Vec<f32>);

/// Everything that changes while a stack streams.
#[derive(Debug)]
pub(super) struct StackState {
    cache: KvCache,
    block: u64,
    /// Block that the sequence started with.
    first: u64,
    rows: Rows,
    pub(super) work: Work,
}

/// Working memory of a pass through a stack.
#[derive(Debug)]
pub(super) struct Work {
    phases: Phases,
    scratch: Scratch,
    /// Token embeddings, and what becomes of them.
    pub(super) x: Vec<f32>,
    normed: Vec<f32>,
    /// Every row uses the one row of its norm's table.
    index: Vec<u32>,
}

impl Stack {
    /// Reads `{prefix}.layers.*` and `{prefix}.ln_f` for blocks of `tokens` tokens.
    pub(super) fn load(t: &Tensors<'_>, kernels: Kernels, c: &VaeConfig, prefix: &str, tokens: usize) -> Result<Self> {
        let (d, mlp) = (c.width, c.width * c.mlp);
        let layer = |i: usize| -> Result<_> {
            let name = |part: &str| format!("{prefix}.layers.{i}.{part}");
            let layer = Layer {
                qkv: t.linear(kernels, &name("qkv"), 3 * d, &[d])?,
                proj: t.linear(kernels, &name("proj"), d, &[d])?,
                fc1: t.linear(kernels, &name("fc1"), mlp, &[d])?,
                fc2: t.linear(kernels, &name("fc2"), d, &[mlp])?,
            };
            Ok((layer, Norms { ln1: Affine::load(t, &name("ln1"), d)?, ln2: Affine::load(t, &name("ln2"), d)? }))
        };
        Ok(Self {
            config: *c,
            tokens,
            layers: (0..c.layers).map(layer).collect::<Result<_>>()?,
            final_norm: Affine::load(t, &format!("{prefix}.ln_f"), d)?,
            rope: Rope::new(d / c.heads),
        })
    }

    /// Bytes of the packed matrices.
    pub(super) fn bytes(&self) -> usize {
        self.layers.iter().map(|(layer, _)| layer.bytes()).sum()
    }

    /// Fresh state; all memory that streaming needs is taken here.
    pub(super) fn state(&self, dtype: KvDtype) -> StackState {
        let (n, d) = (self.tokens, self.config.width);
        StackState {
            cache: KvCache::new(self.layers.len(), n * self.config.window_blocks, self.config.heads, d, dtype),
            block: 0,
            first: 0,
            rows: Rows::with_capacity(n),
            work: self.work(1),
        }
    }

    /// Working memory for blocks of up to `states` states, which run together.
    pub(super) fn work(&self, states: usize) -> Work {
        let (n, d) = (self.tokens * states, self.config.width);
        Work {
            phases: self.rope.phases(n),
            scratch: Scratch::new(n, d, d * self.config.mlp),
            x: vec![0.0; n * d],
            normed: vec![0.0; n * d],
            index: vec![0; n],
        }
    }

    /// Runs the block whose token embeddings are in `state.work.x`; returns the normed outputs, `tokens x width`.
    pub(super) fn step<'s>(&self, exec: &mut Exec, state: &'s mut StackState) -> &'s [f32] {
        self.stage(state);
        let StackState { cache, rows, work, .. } = state;
        self.run(exec, self.tokens, work, &mut |exec, layer, qkv, out| rows.attend(exec, layer, cache, qkv, out))
    }

    /// The same for the states of all `members`, whose rows go through the layers together; returns the outputs of
    /// all, one after the other. A row's results depend on that row and its own cache alone, bit for bit.
    pub(super) fn step_all<'w, M>(
        &self,
        exec: &mut Exec,
        work: &'w mut Work,
        members: &mut [Option<M>],
        state: impl for<'a> Fn(&'a mut M) -> &'a mut StackState + Copy,
    ) -> &'w [f32] {
        let (n, d) = (self.tokens, self.config.width);
        let mut rows = 0;
        for state in members.iter_mut().flatten().map(state) {
            self.stage(state);
            work.x[rows * d..][..n * d].copy_from_slice(&state.work.x);
            work.phases.copy_rows(rows, &state.work.phases, n, d / self.config.heads / 2);
            rows += n;
        }
        self.run(exec, rows, work, &mut |exec, layer, qkv, out| {
            let states = members.iter_mut().flatten().map(state);
            for ((state, qkv), out) in states.zip(qkv.chunks_exact(n * 3 * d)).zip(out.chunks_exact_mut(n * d)) {
                state.rows.attend(exec, layer, &mut state.cache, qkv, out);
            }
        })
    }

    /// Fills the rows of a block and goes on to the next.
    fn stage(&self, state: &mut StackState) {
        let n = self.tokens as u64;
        let oldest = (state.block + 1).saturating_sub(self.config.window_blocks as u64).max(state.first);
        state.rows.clear();
        for row in 0..n {
            let position = state.block * n + row;
            state.rows.push(0, position, oldest * n);
            self.rope.fill(&mut state.work.phases, row as usize, position);
        }
        state.block += 1;
    }

    /// Runs the first `n` rows of `work` through the layers and returns the normed outputs.
    fn run<'w>(&self, exec: &mut Exec, n: usize, work: &'w mut Work, attend: &mut Attention<'_>) -> &'w [f32] {
        let d = self.config.width;
        let Work { phases, scratch, x, normed, index } = work;
        let (index, normed) = (&index[..n], &mut normed[..n * d]);
        let layers = self.layers.iter().map(|(layer, norms)| {
            let norms = LayerNorms {
                norm1: norms.ln1.tables(d, index),
                gate1: None,
                norm2: norms.ln2.tables(d, index),
                gate2: None,
            };
            (layer, norms)
        });
        run_layers(exec, self.config.heads, layers, None, phases, n, scratch, x, attend);
        let (shift, scale) = self.final_norm.tables(d, index);
        exec.norm(&x[..n * d], n, d, shift, scale, normed);
        normed
    }
}

impl Affine {
    fn load(t: &Tensors<'_>, name: &str, d: usize) -> Result<Self> {
        let mut table = t.f32(&format!("{name}.bias"), &[d])?;
        table.extend(t.f32(&format!("{name}.weight"), &[d])?);
        Ok(Self(table))
    }

    /// Shift (bias) and scale (weight) of width `d` for the rows in `index`.
    fn tables<'a>(&'a self, d: usize, index: &'a [u32]) -> (RowTable<'a>, RowTable<'a>) {
        let table = |offset| RowTable { table: &self.0, stride: 2 * d, offset, index };
        (table(0), table(d))
    }
}

impl StackState {
    /// Forgets everything: the next block, number `first`, starts a new sequence.
    pub(super) fn reset(&mut self, first: u64) {
        (self.first, self.block) = (first, first);
    }

    /// Takes back the last block: the next one is written over it.
    #[cfg(feature = "internals")]
    pub(super) fn back(&mut self) {
        self.block -= 1;
    }

    /// Bytes of the ring cache.
    pub(super) fn cache_bytes(&self) -> usize {
        self.cache.bytes()
    }
}
