//! The decoder: one latent in, four frames of pose features out.

use super::stack::{Stack, StackState};
use super::work::Work;
use crate::bundle::Tensors;
use crate::config::VaeConfig;
use crate::error::Result;
use crate::frame::BLOCK_FRAMES;
use crate::kernels::{Epilogue, Exec, Kernels, KvDtype, Matrix};
use crate::normaliser::{Metric, Standardised};

/// Tokens of a block: the latent and one per frame.
pub(super) const TOKENS: usize = 1 + BLOCK_FRAMES;

/// Weights of the decoder.
#[derive(Debug)]
pub struct Decoder {
    stack: Stack,
    latent: Matrix,
    /// Embeddings of the five tokens before the latent is added: slot, and frame token where there
    /// is one.
    tokens: Vec<f32>,
    out: Matrix,
}

/// A decoder's streaming state.
#[derive(Debug)]
pub struct DecoderState(StackState);

/// A block that is decoded.
#[derive(Debug)]
pub struct Decoding<'a> {
    /// The state.
    pub state: &'a mut DecoderState,
    /// The latent, `[latent]`.
    pub z: Metric<&'a [f32]>,
    /// What becomes the features, `[4, features]`.
    pub out: Standardised<&'a mut [f32]>,
}

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

    /// Working memory to decode up to `blocks` blocks together, or to encode one.
    pub fn work(&self, blocks: usize) -> Work {
        let rows = (blocks * TOKENS).max(super::encoder::TOKENS);
        Work { pass: self.stack.pass(rows), out: vec![0.0; blocks * BLOCK_FRAMES * self.out.out_features()] }
    }

    /// Decodes a block.
    pub fn step(&self, exec: &mut Exec, work: &mut Work, block: Decoding<'_>) {
        self.step_all(exec, work, &mut [block], |block| Some(block.borrowed()));
    }

    /// Decodes the next block of each of `members` that has one, with one pass over the weights.
    ///
    /// # Panics
    /// When there are more of them than `work` is for.
    pub fn step_all<M>(
        &self,
        exec: &mut Exec,
        work: &mut Work,
        members: &mut [M],
        block: impl for<'a> Fn(&'a mut M) -> Option<Decoding<'a>> + Copy,
    ) {
        let Work { pass, out } = work;
        pass.clear();
        for Decoding { state, z, .. } in members.iter_mut().filter_map(block) {
            let x = self.stack.push(&mut state.0, pass);
            x.copy_from_slice(&self.tokens);
            exec.linear(&self.latent, z.values(), 1, &mut x[..self.latent.out_features()], Epilogue::Add);
        }
        if pass.rows() == 0 {
            return;
        }
        self.stack.run(exec, pass, members, |member| block(member).map(|block| &mut block.state.0), 1..TOKENS);
        let features = pass.project(exec, &self.out, out);
        let blocks = features.chunks_exact(BLOCK_FRAMES * self.out.out_features());
        for (mut member, features) in members.iter_mut().filter_map(block).zip(blocks) {
            member.out.values_mut().copy_from_slice(features);
        }
    }
}

impl Decoding<'_> {
    /// The same for a shorter time.
    fn borrowed(&mut self) -> Decoding<'_> {
        Decoding { state: self.state, z: self.z, out: self.out.view_mut() }
    }
}

impl DecoderState {
    /// Forgets the past; the next block gets the number `first`, from which positions count on.
    pub fn reset(&mut self, first: u64) {
        self.0.reset(first);
    }

    /// Takes back the last block, if there is one, so that the next one takes its place
    /// (teacher-forced comparisons).
    #[cfg(feature = "internals")]
    pub fn back(&mut self) {
        self.0.back();
    }

    /// Bytes of the ring cache.
    pub fn cache_bytes(&self) -> usize {
        self.0.cache_bytes()
    }
}
