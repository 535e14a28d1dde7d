//! Bundles: one safetensors file that holds a model's weights and, in its metadata, its
//! configuration.
//!
//! Opening a bundle checks everything before any of it is used: the container, the config's ranges,
//! each tensor's name, dtype and shape, and that every number is finite. Sizes are bounded by the
//! file's own before memory is taken.

mod audio;
mod check;
mod drawn;
mod file;
mod parse;
mod read;
mod rewrite;
mod stored;
mod tensors;

pub use audio::AudioSource;
pub use file::{BundleFile, LoadMode};
#[cfg(feature = "quant")]
pub(crate) use rewrite::{Entry, assemble, entries, failed, floats};
pub use stored::{SMALL, StoredData, StoredWeights, int16_activations};
pub use tensors::{TensorInfo, Tensors};

use crate::error::{Error, ErrorKind};

/// Key of the config in the safetensors metadata.
pub const CONFIG_KEY: &str = "visavis";
/// The idle clip's frames, in bundles as they are exported.
pub(crate) const IDLE_FRAMES: &str = "idle.frames";
/// Its latents, in their place in quantised bundles.
pub(crate) const IDLE_LATENTS: &str = "idle.latents";

fn corrupt(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::BundleCorrupt, message)
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::BundleInvalid, message)
}
