//! Motion through encoder and decoder, as training saw it.

use super::{Decoder, DecoderState, Decoding, Encoder, EncoderState, Work};
use crate::kernels::{Exec, KvDtype};
use crate::normaliser::{Metric, Standardised};

/// Streams blocks through an encoder and a decoder: what a latent holds of a motion.
#[derive(Debug)]
pub struct RoundTrip<'a> {
    encoder: (&'a Encoder, EncoderState),
    decoder: (&'a Decoder, DecoderState),
    work: Work,
    z: Metric,
}

impl<'a> RoundTrip<'a> {
    /// At the start of a motion; latents have `latent` channels.
    pub fn new(encoder: &'a Encoder, decoder: &'a Decoder, latent: usize, dtype: KvDtype) -> Self {
        Self {
            encoder: (encoder, encoder.state(dtype)),
            decoder: (decoder, decoder.state(dtype)),
            work: decoder.work(1),
            z: Metric::zeros(latent),
        }
    }

    /// The next block: `frames` and `out` are `[4, features]`.
    pub fn step(&mut self, exec: &mut Exec, frames: Standardised<&[f32]>, out: Standardised<&mut [f32]>) {
        let Self { encoder: (encoder, encoding), decoder: (decoder, state), work, z } = self;
        encoder.step(exec, work, encoding, frames, z.view_mut());
        decoder.step(exec, work, Decoding { state, z: z.view(), out });
    }
}
