//! The transformer stack that encoder and decoder share: plain layer norms, one ring a layer.

use crate::bundle::Tensors;
use crate::config::VaeConfig;
use crate::error::Result;
use crate::kernels::{Exec, Kernels, KvCache, KvDtype, RowTable};
use crate::nn::{Layer, LayerNorms, Phases, Rope, Rows, Scratch};

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
    phases: Phases,
    scratch: Scratch,
    pub(super) x: Vec<f32>,
    normed: Vec<f32>,
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
            phases: self.rope.phases(n),
            scratch: Scratch::new(n, d, d * self.config.mlp),
            x: vec![0.0; n * d],
            normed: vec![0.0; n * d],
        }
    }

    /// Runs the block whose token embeddings are in `state.x`; returns the normed outputs, `tokens x width`.
    pub(super) fn step<'s>(&self, exec: &mut Exec, state: &'s mut StackState) -> &'s [f32] {
        let (n, d) = (self.tokens as u64, self.config.width);
        let oldest = (state.block + 1).saturating_sub(self.config.window_blocks as u64).max(state.first);
        state.rows.clear();
        for row in 0..n {
            let position = state.block * n + row;
            state.rows.push(0, position, oldest * n);
            self.rope.fill(&mut state.phases, row as usize, position);
        }
        state.block += 1;
        let index = &ROW_ZERO[..n as usize];
        for (i, (layer, norms)) in self.layers.iter().enumerate() {
            let norms = LayerNorms {
                norm1: norms.ln1.tables(d, index),
                gate1: None,
                norm2: norms.ln2.tables(d, index),
                gate2: None,
            };
            let heads = self.config.heads;
            let StackState { cache, rows, phases, scratch, x, .. } = &mut *state;
            layer.run(
                exec,
                heads,
                norms,
                phases,
                n as usize,
                scratch,
                x,
                &mut |exec, qkv, out| {
                    rows.attend(exec, i, cache, qkv, out);
                },
                self.layers.get(i + 1).map(|(layer, _)| layer),
            );
        }
        let (shift, scale) = self.final_norm.tables(d, index);
        exec.norm(&state.x, n as usize, d, shift, scale, &mut state.normed);
        &state.normed
    }
}

/// Every row of a VAE pass uses the one row of its norm's table.
const ROW_ZERO: [u32; 8] = [0; 8];

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
    pub(super) fn back(&mut self) {
        self.block -= 1;
    }

    /// Bytes of the ring cache.
    pub(super) fn cache_bytes(&self) -> usize {
        self.cache.bytes()
    }
}
