//! What networks share: of transformers layers, passes of rows through them over ring caches, plain
//! norms and rotary phases (`training/visavis_train/nets/layers.py`); a layer of LSTM cells.

mod layer;
mod lstm;
mod pass;
mod plain;
mod rope;

pub use layer::{Layer, Rows};
pub use lstm::Lstm;
pub use pass::{Attention, LayerNorms, Norms, Pass, Sizes};
pub use plain::{Affine, PlainNorms};
pub use rope::{PERIOD, Phases, Rope};
