//! The decoder: one latent in, four frames of pose features out.

use super::stack::{Stack, StackState};
use crate::bundle::Tensors;
use crate::config::VaeConfig;
use crate::error::Result;
use crate::frame::BLOCK_FRAMES;
use crate::kernels::{Epilogue, Exec, Kernels, KvDtype, Matrix};

/// Tokens of a block: the latent and four frame slots.
const TOKENS: usize = 1 + BLOCK_FRAMES;

/// Weights of the decoder.
#[derive(Debug)]
pub struct Decoder {
    stack: Stack,
    latent: Matrix,
    /// Embeddings of the five tokens before the latent is added: slot, and frame token where there is one.
    tokens: Vec<f32>,
    out: Matrix,
}

/// A decoder's streaming state.
#[derive(Debug)]
pub struct DecoderState(StackState);

impl Decoder {
    /// Reads `vae.decoder.*` for poses of `features` channels.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn load(t: &Tensors<'_>, kernels: Kernels, c: &VaeConfig, features: usize) -> Result<Self> {
        let d = c.width;
        let mut tokens = t.f32("vae.decoder.slot", &[TOKENS, d])?;
        let frames = t.f32("vae.decoder.frame_token", &[BLOCK_FRAMES, d])?;
        tokens[d..].iter_mut().zip(frames).for_each(|(token, frame)| *token += frame);
        Ok(Self {
            stack: Stack::load(t, kernels, c, "vae.decoder", TOKENS)?,
            latent: t.linear(kernels, "vae.decoder.latent", d, &[c.latent])?,
            tokens,
            out: t.linear(kernels, "vae.decoder.out", features, &[d])?,
        })
    }

    /// Bytes of the packed matrices, all of which a block reads.
    pub fn bytes(&self) -> usize {
        self.stack.bytes() + self.latent.bytes() + self.out.bytes()
    }

    /// Fresh state.
    pub fn state(&self, dtype: KvDtype) -> DecoderState {
        DecoderState(self.stack.state(dtype))
    }

    /// Decodes the next block: `z` is `[latent]`, unstandardised; `out` becomes `[4, features]`, standardised.
    pub fn step(&self, exec: &mut Exec, state: &mut DecoderState, z: &[f32], out: &mut [f32]) {
        let d = self.latent.out_features();
        state.0.x.copy_from_slice(&self.tokens);
        exec.linear(&self.latent, z, 1, &mut state.0.x[..d], Epilogue::Add);
        let hidden = self.stack.step(exec, &mut state.0);
        exec.linear(&self.out, &hidden[d..], BLOCK_FRAMES, out, Epilogue::Store);
    }
}

impl DecoderState {
    /// Forgets the past; the next block gets the number `first`, from which positions count on.
    pub fn reset(&mut self, first: u64) {
        self.0.reset(first);
    }

    /// Takes back the last block, so that the next one takes its place (teacher-forced comparisons).
    ///
    /// # Panics
    /// When there is none.
    pub fn back(&mut self) {
        self.0.back();
    }

    /// Bytes of the ring cache.
    pub fn cache_bytes(&self) -> usize {
        self.0.cache_bytes()
    }
}
