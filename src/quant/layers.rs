//! The weight matrices of a bundle.

use crate::bundle::{StoredWeights, Tensors};
use crate::error::Result;
use crate::kernels::Scheme;

/// A layer with a weight matrix.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Name, without the `.weight` of its tensor.
    pub name: String,
    /// Shape of the tensor of floats.
    pub shape: Vec<usize>,
    /// The weights.
    pub weights: StoredWeights,
}

impl Layer {
    /// Number of weights.
    pub fn elements(&self) -> usize {
        self.weights.rows * self.weights.cols
    }
}

/// The layers of an unquantised bundle, by name: every `*.weight` of two or more dimensions.
///
/// # Errors
/// As [`Tensors::weights`].
pub fn layers(tensors: &Tensors<'_>) -> Result<Vec<Layer>> {
    let infos = tensors.infos().into_iter().filter(|t| t.shape.len() >= 2);
    let named = infos.filter_map(|t| Some((t.name.strip_suffix(".weight")?.to_owned(), t.shape)));
    named
        .map(|(name, shape)| {
            let weights = tensors.weights(&name, shape[0], &shape[1..])?;
            Ok(Layer { name, shape, weights })
        })
        .collect()
}

/// Layers of the audio encoder with as many weights as this are worth their int8.
const LARGE: usize = 150_000;

/// The scheme that layer `name` gets when `scheme` is asked for, if it is large enough to be
/// quantised at all.
///
/// - The flow's input projection and its latent embedding are multiplied with each other when a
///   bundle is loaded: f16 at most.
/// - The audio encoders' features, and what is made of them, condition everything that follows. Its three largest convolutions
///   are int8 in int8 and int4 bundles, its other layers f16 and int8.
/// - The last layers of flow and decoder are int8 in int4 bundles. They are small and nothing evens
///   their errors out: measured on the base model, the decoder's alone was two thirds of the joint
///   error.
pub fn default_scheme(name: &str, elements: usize, scheme: Scheme) -> Scheme {
    let folded = name.ends_with(".input") || name.ends_with(".embed_latent");
    let audio = ["audio.", "hearing.", "appraisal."].iter().any(|prefix| name.starts_with(prefix));
    let last = name.ends_with(".final.out") || name == "vae.decoder.out";
    match scheme {
        Scheme::I8 | Scheme::I4 if folded => Scheme::F16,
        Scheme::I8 if audio && elements < LARGE => Scheme::F16,
        Scheme::I4 if audio || last => Scheme::I8,
        other => other,
    }
}
