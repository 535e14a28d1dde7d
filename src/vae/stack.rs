//! The transformer stack that encoder and decoder share: plain layer norms, one ring per layer.

use crate::bundle::Tensors;
use crate::config::VaeConfig;
use crate::error::Result;
use crate::kernels::{Exec, Kernels, KvCache, KvDtype};
use crate::nn::{Affine, Layer, Pass, PlainNorms, Rope, Rows, Sizes};

/// Weights of a stack of layers and its final norm.
#[derive(Debug)]
pub(super) struct Stack {
    config: VaeConfig,
    tokens: usize,
    layers: Vec<Layer>,
    norms: PlainNorms,
    rope: Rope,
}

/// Everything that changes while a stack streams.
#[derive(Debug)]
pub(super) struct StackState {
    cache: KvCache,
    block: u64,
    /// Block that the sequence started with.
    first: u64,
    rows: Rows,
}

impl Stack {
    /// Reads `{prefix}.layers.*` and `{prefix}.ln_f` for blocks of `tokens` tokens.
    pub(super) fn load(t: &Tensors<'_>, kernels: Kernels, c: &VaeConfig, prefix: &str, tokens: usize) -> Result<Self> {
        let (d, mlp) = (c.width, c.width * c.mlp);
        let (mut layers, mut norms) = (Vec::with_capacity(c.layers), Vec::with_capacity(c.layers));
        for i in 0..c.layers {
            let name = |part: &str| format!("{prefix}.layers.{i}.{part}");
            layers.push(Layer {
                qkv: t.linear(kernels, &name("qkv"), 3 * d, &[d])?,
                proj: t.linear(kernels, &name("proj"), d, &[d])?,
                fc1: t.linear(kernels, &name("fc1"), mlp, &[d])?,
                fc2: t.linear(kernels, &name("fc2"), d, &[mlp])?,
            });
            norms.push([affine(t, &name("ln1"), d)?, affine(t, &name("ln2"), d)?]);
        }
        Ok(Self {
            config: *c,
            tokens,
            layers,
            norms: PlainNorms { layers: norms, last: affine(t, &format!("{prefix}.ln_f"), d)? },
            rope: Rope::new(d / c.heads),
        })
    }

    /// Bytes of the packed matrices.
    pub(super) fn bytes(&self) -> usize {
        self.layers.iter().map(Layer::bytes).sum()
    }

    /// Fresh state; all memory that streaming needs is taken here, but for a pass.
    pub(super) fn state(&self, dtype: KvDtype) -> StackState {
        let (n, c) = (self.tokens, &self.config);
        StackState {
            cache: KvCache::new(self.layers.len(), n * c.window_blocks, c.heads, c.width, dtype),
            block: 0,
            first: 0,
            rows: Rows::with_capacity(n),
        }
    }

    /// A pass for up to `rows` tokens.
    pub(super) fn pass(&self, rows: usize) -> Pass {
        let VaeConfig { width, heads, mlp, .. } = self.config;
        Pass::new(Sizes { width, heads, hidden: width * mlp }, rows, &self.rope)
    }

    /// Adds the tokens of the next block of `state` to `pass` and hands out their embeddings to be
    /// filled, `tokens x width`.
    pub(super) fn push<'p>(&self, state: &mut StackState, pass: &'p mut Pass) -> &'p mut [f32] {
        let n = self.tokens as u64;
        let oldest = (state.block + 1).saturating_sub(self.config.window_blocks as u64).max(state.first);
        let from = pass.rows();
        state.rows.clear();
        for position in state.block * n..(state.block + 1) * n {
            state.rows.push(0, position, oldest * n);
            pass.push(&self.rope, position, 0);
        }
        state.block += 1;
        pass.input(from..from + self.tokens)
    }

    /// Runs the blocks that were pushed, one of each of `members`, and reads tokens `read` of each:
    /// normed, member by member.
    pub(super) fn run<M>(
        &self,
        exec: &mut Exec,
        pass: &mut Pass,
        members: &mut [M],
        state: impl for<'a> Fn(&'a mut M) -> Option<&'a mut StackState> + Copy,
        read: std::ops::Range<usize>,
    ) {
        let (n, d) = (self.tokens, self.config.width);
        pass.run(exec, &self.layers, &self.norms, None, &mut |exec, layer, qkv, out| {
            let states = members.iter_mut().filter_map(state);
            for ((state, qkv), out) in states.zip(qkv.chunks_exact(n * 3 * d)).zip(out.chunks_exact_mut(n * d)) {
                state.rows.attend(exec, layer, &mut state.cache, qkv, out);
            }
        });
        for first in (0..pass.rows()).step_by(n) {
            pass.read(exec, &self.norms, first + read.start..first + read.end);
        }
    }
}

/// Reads `{name}.bias` and `{name}.weight`.
fn affine(t: &Tensors<'_>, name: &str, d: usize) -> Result<Affine> {
    Ok(Affine::new(&t.f32(&format!("{name}.bias"), &[d])?, &t.f32(&format!("{name}.weight"), &[d])?))
}

impl StackState {
    /// Forgets everything: the next block, number `first`, starts a new sequence.
    pub(super) fn reset(&mut self, first: u64) {
        (self.first, self.block) = (first, first);
    }

    /// Takes back the last block, if there is one: the next one is written over it.
    #[cfg(feature = "internals")]
    pub(super) fn back(&mut self) {
        self.block = self.block.saturating_sub(1).max(self.first);
    }

    /// Bytes of the ring cache.
    pub(super) fn cache_bytes(&self) -> usize {
        self.cache.bytes()
    }
}
