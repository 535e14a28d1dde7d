//! The encoder: four frames of pose features in, the mean of their latent out.
//!
//! A session needs it to start from the idle clip and to re-anchor; the variance serves training
//! alone and is not read.

use super::stack::{Stack, StackState};
use super::work::Work;
use crate::bundle::Tensors;
use crate::config::VaeConfig;
use crate::error::Result;
use crate::frame::BLOCK_FRAMES;
use crate::kernels::{Epilogue, Exec, Kernels, KvDtype, Matrix};
use crate::normaliser::{Metric, Standardised};

/// Tokens of a block: four frames, `mu` and `sigma`.
pub(super) const TOKENS: usize = BLOCK_FRAMES + 2;

/// Weights of the encoder.
#[derive(Debug)]
pub struct Encoder {
    stack: Stack,
    frame: Matrix,
    /// Embeddings of the six tokens before the frames are added: slot, and `mu` or `sigma` token
    /// where there is one.
    tokens: Vec<f32>,
    mu: Matrix,
}

/// An encoder's streaming state.
#[derive(Debug)]
pub struct EncoderState(StackState);

impl Encoder {
    /// Reads `vae.encoder.*` for poses of `features` channels.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn load(t: &Tensors<'_>, kernels: Kernels, c: &VaeConfig, features: usize) -> Result<Self> {
        let d = c.width;
        let mut tokens = t.f32("vae.encoder.slot", &[TOKENS, d])?;
        let mut learned = t.f32("vae.encoder.mu_token", &[d])?;
        learned.extend(t.f32("vae.encoder.sigma_token", &[d])?);
        tokens[BLOCK_FRAMES * d..].iter_mut().zip(learned).for_each(|(token, extra)| *token += extra);
        t.linear(kernels, "vae.encoder.logvar", c.latent, &[d])?;
        Ok(Self {
            stack: Stack::load(t, kernels, c, "vae.encoder", TOKENS)?,
            frame: t.linear(kernels, "vae.encoder.frame", d, &[features])?,
            tokens,
            mu: t.linear(kernels, "vae.encoder.mu", c.latent, &[d])?,
        })
    }

    /// Bytes of the packed matrices, all of which a block reads.
    pub fn bytes(&self) -> usize {
        self.stack.bytes() + self.frame.bytes() + self.mu.bytes()
    }

    /// Fresh state.
    pub fn state(&self, dtype: KvDtype) -> EncoderState {
        EncoderState(self.stack.state(dtype))
    }

    /// Encodes the next block: `frames` is `[4, features]`; `mu` becomes the latent, `[latent]`.
    pub fn step(
        &self,
        exec: &mut Exec,
        work: &mut Work,
        state: &mut EncoderState,
        frames: Standardised<&[f32]>,
        mut mu: Metric<&mut [f32]>,
    ) {
        let d = self.frame.out_features();
        let pass = &mut work.pass;
        pass.clear();
        let x = self.stack.push(&mut state.0, pass);
        x.copy_from_slice(&self.tokens);
        exec.linear(&self.frame, frames.values(), BLOCK_FRAMES, &mut x[..BLOCK_FRAMES * d], Epilogue::Add);
        self.stack.run(exec, pass, &mut [&mut state.0], |state| Some(&mut **state), BLOCK_FRAMES..BLOCK_FRAMES + 1);
        pass.project(exec, &self.mu, mu.values_mut());
    }
}

impl EncoderState {
    /// Forgets the past; the next block gets the number `first`, from which positions count on.
    pub fn reset(&mut self, first: u64) {
        self.0.reset(first);
    }

    /// Bytes of the ring cache.
    pub fn cache_bytes(&self) -> usize {
        self.0.cache_bytes()
    }
}
