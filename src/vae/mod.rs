//! The causal transformer VAE of motion (SARAH 3.2): four frames in, one latent out, and back.
//!
//! Tokens of a block are interleaved with those of the blocks before it: the encoder's are four
//! frames, `mu` and `sigma`; the decoder's are the latent and one per frame. A token sees the
//! tokens before it, back to the start of the block `window_blocks - 1` before its own. Both
//! stream: one block per call, keys and values in a ring.
//!
//! Mirrors `training/visavis_train/nets/vae.py`.

mod decoder;
mod encoder;
#[cfg(feature = "internals")]
mod round_trip;
mod stack;
mod work;

pub use decoder::{Decoder, DecoderState, Decoding};
pub use encoder::{Encoder, EncoderState};
#[cfg(feature = "internals")]
pub use round_trip::RoundTrip;
pub use work::Work;
