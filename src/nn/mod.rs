//! What the transformers share: layers, passes of rows through them over ring caches, plain norms,
//! and rotary phases.
//!
//! Mirrors `training/visavis_train/nets/layers.py`.

mod layer;
mod pass;
mod plain;
mod rope;

pub use layer::{Layer, Rows};
pub use pass::{Attention, LayerNorms, Norms, Pass, Sizes};
pub use plain::{Affine, PlainNorms};
pub use rope::{PERIOD, Phases, Rope};
