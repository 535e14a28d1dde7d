//! The decoder: one latent in, four frames of pose features out.

use super::stack::{Stack, StackState, Work};
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

/// One of several blocks that are decoded together: what [`Decoder::step`] gets.
#[derive(Debug)]
pub struct Decoding<'a> {
    /// The state.
    pub state: &'a mut DecoderState,
    /// The latent.
    pub z: &'a [f32],
    /// The features.
    pub out: &'a mut [f32],
}

/// Working memory of blocks that are decoded together.
#[derive(Debug)]
pub struct SharedDecoding {
    work: Work,
    /// The frames' tokens of all.
    hidden: Vec<f32>,
    out: Vec<f32>,
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

    /// Decodes the next block: `z` is `[latent]`, unstandardised; `out` becomes `[4, features]`, standardised.
    pub fn step(&self, exec: &mut Exec, state: &mut DecoderState, z: &[f32], out: &mut [f32]) {
        self.embed(exec, state, z);
        let hidden = self.stack.step(exec, &mut state.0);
        exec.linear(&self.out, &hidden[self.width()..], BLOCK_FRAMES, out, Epilogue::Store);
    }

    /// Working memory to decode up to `members` blocks together.
    pub fn shared(&self, members: usize) -> SharedDecoding {
        let frames = members * BLOCK_FRAMES;
        SharedDecoding {
            work: self.stack.work(members),
            hidden: vec![0.0; frames * self.width()],
            out: vec![0.0; frames * self.out.out_features()],
        }
    }

    /// Decodes the next block of each of `members`, as [`Decoder::step`] does one, with one pass over the weights.
    ///
    /// # Panics
    /// When there are more of them than `shared` is for.
    pub fn step_all(&self, exec: &mut Exec, shared: &mut SharedDecoding, members: &mut [Option<Decoding<'_>>]) {
        let (d, features) = (self.width(), self.out.out_features());
        for member in members.iter_mut().flatten() {
            self.embed(exec, member.state, member.z);
        }
        let SharedDecoding { work, hidden, out } = shared;
        let tokens = self.stack.step_all(exec, work, members, |member| &mut member.state.0);
        for (tokens, hidden) in tokens.chunks_exact(TOKENS * d).zip(hidden.chunks_exact_mut(BLOCK_FRAMES * d)) {
            hidden.copy_from_slice(&tokens[d..]);
        }
        let frames = tokens.len() / (TOKENS * d) * BLOCK_FRAMES;
        let out = &mut out[..frames * features];
        exec.linear(&self.out, &hidden[..frames * d], frames, out, Epilogue::Store);
        for (member, out) in members.iter_mut().flatten().zip(out.chunks_exact(BLOCK_FRAMES * features)) {
            member.out.copy_from_slice(out);
        }
    }

    /// Token embeddings of the next block.
    fn embed(&self, exec: &mut Exec, state: &mut DecoderState, z: &[f32]) {
        let x = &mut state.0.work.x;
        x.copy_from_slice(&self.tokens);
        exec.linear(&self.latent, z, 1, &mut x[..self.width()], Epilogue::Add);
    }

    fn width(&self) -> usize {
        self.latent.out_features()
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
    #[cfg(feature = "internals")]
    pub fn back(&mut self) {
        self.0.back();
    }

    /// Bytes of the ring cache.
    pub fn cache_bytes(&self) -> usize {
        self.0.cache_bytes()
    }
}
