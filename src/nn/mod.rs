//! What the causal transformers share: layers, passes of rows through them over ring caches, and
//! rotary phases.
//!
//! Mirrors `training/visavis_train/nets/layers.py`.

mod layer;
mod pass;
mod rope;

pub use layer::{Layer, Rows};
pub use pass::{Attention, LayerNorms, Norms, Pass, Sizes};
pub use rope::{PERIOD, Phases, Rope};
