//! Working memory of encoder and decoder, which have layers of the same sizes.

use crate::nn::Pass;

/// What decoding some blocks, or encoding one, needs besides weights and states
/// ([`super::Decoder::work`]).
#[derive(Debug)]
pub struct Work {
    pub(super) pass: Pass,
    /// Features of all blocks that are decoded together.
    pub(super) out: Vec<f32>,
}
