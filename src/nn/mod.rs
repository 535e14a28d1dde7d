//! What the causal transformers share: the pre-norm layer over a ring cache, and rotary phases.
//!
//! Mirrors `training/visavis_train/nets/layers.py`.

mod layer;
mod rope;

pub use layer::{Attention, Layer, LayerNorms, Rows, Scratch, run_layers};
pub use rope::{PERIOD, Phases, Rope};
