//! The quantiser: a bundle of floats in, the same bundle with int8, int4 or half-float weights out.
//!
//! | file | what |
//! |---|---|
//! | `layers` | the weight matrices of a bundle, and which of them are worth quantising |
//! | `keep` | patterns of layer names that stay floats |
//! | `round` | rounding to each scheme, with the scale that loses least |
//! | `nearest_plane` | rounding by activation statistics |
//! | `calibration` | those statistics, of a reference run over a conversation |
//! | `scene` | a conversation in blocks, played to sessions |
//! | `teacher` | what quantisation does to a block: teacher-forced runs of two engines side by side |
//! | `auto` | the scheme of each layer by measured sensitivity |
//! | `write` | putting the bundle together |
//!
//! Weights are quantised one layer at a time: int8 symmetric per output channel, int4 symmetric in
//! groups of 32 columns with an f16 scale. Activations are quantised when they come, per row, to
//! int8 or, where [`int16_activations`](crate::bundle::int16_activations) says so, int16; nothing
//! about them is stored. In int8 and int4 bundles biases, norms, embeddings of tokens and
//! statistics stay as they are; in f16 bundles all but the statistics and the decoder's are f16 as
//! well. The frames of the idle clip, a fiftieth of an int4 bundle, give way to their latents,
//! which are all that an engine wants of them. The result depends on the input bundle and the
//! options alone, bit for bit.

mod auto;
mod calibration;
mod keep;
mod layers;
mod nearest_plane;
mod round;
mod scene;
mod teacher;
#[cfg(test)]
mod tests;
mod write;

pub use crate::bundle::SMALL;
pub use auto::{Budget, Choice};
pub use calibration::Calibration;
pub use keep::Keep;
pub use layers::{Layer, default_scheme, layers};
pub use round::{round, sqnr_db};
pub use scene::{Scene, Sound};
pub use teacher::{Forced, FrameError, Teacher};

use crate::bundle::{BundleFile, StoredWeights, Tensors};
use crate::config::{Config, Kind, Quantisation};
use crate::engine::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::kernels::{Kernels, Scheme};
use crate::mospa::Reactor;
use std::collections::BTreeMap;

/// What to do with the weights.
#[derive(Debug)]
pub struct Options<'a> {
    /// Scheme of every layer that nothing else is said about: `f16`, `i8` or `i4`.
    pub scheme: Scheme,
    /// Matrices with fewer weights are not made integers, so stay as they are but in f16 bundles;
    /// [`SMALL`] unless there is a reason.
    pub smallest: usize,
    /// Layers that stay floats; the last pattern that fits a layer decides.
    pub keep: &'a [Keep],
    /// What flows through the layers: int8 and int4 weights are rounded so that outputs on such
    /// inputs lose least. Without it each weight goes to the nearest value.
    pub calibration: Option<&'a Scene>,
    /// Raises layers to better schemes until blocks are within a budget of error.
    pub budget: Option<&'a Budget<'a>>,
}

/// A quantised bundle.
#[derive(Debug)]
pub struct Quantised {
    /// The file.
    pub bytes: Vec<u8>,
    /// Scheme of each layer.
    pub schemes: BTreeMap<String, Scheme>,
    /// Of a run with a budget: what was tried.
    pub choice: Option<Choice>,
}

/// Quantises the weights of `file`.
///
/// # Errors
/// Those of loading the bundle; [`ErrorKind::Argument`] when it is quantised already, when a
/// pattern fits no layer, or when a weight is beyond the range of f16.
pub fn quantise(file: &BundleFile<'_>, options: &Options<'_>) -> Result<Quantised> {
    let (config, tensors) = file.parse()?;
    refuse_twice(&config, &tensors, options.scheme).map_err(|e| e.with_path(file.path()))?;
    // Everything that loading checks holds from here on.
    let kernels = Kernels::detect()?;
    let reference = match config.kind {
        // It has no sessions.
        Kind::Mospa => Reactor::load(file, kernels).map(|_| None)?,
        _ => Some(Engine::from_file(file, kernels)?),
    };
    // Statistics and sensitivity are measured on latents.
    let sessions = || {
        reference.as_ref().filter(|engine| engine.sarah().is_ok()).ok_or_else(|| {
            let kind = config.kind.name();
            argument(format!(
                "calibration and budgets are for bundles of the kind `sarah`; leave them out for `{kind}`"
            ))
        })
    };
    let layers = layers(&tensors)?;
    let schemes = keep::apply(options, &layers)?;
    let calibration = options.calibration.map(|scene| Calibration::new(sessions()?, scene)).transpose()?;
    let rounder = Rounder { layers: &layers, calibration: calibration.as_ref() };
    let (schemes, choice) = match options.budget {
        None => (schemes, None),
        Some(budget) => {
            let (schemes, choice) = auto::choose(file, sessions()?, &rounder, schemes, options.keep, budget)?;
            (schemes, Some(choice))
        }
    };
    let bytes = write::bundle(file, reference.as_deref(), &rounder.all(&schemes)?, options.scheme)?;
    Ok(Quantised { bytes, schemes, choice })
}

/// Layers and what is known of their inputs.
struct Rounder<'a> {
    layers: &'a [Layer],
    calibration: Option<&'a Calibration>,
}

impl<'a> Rounder<'a> {
    /// One layer at `scheme`; as it is where it is stored so.
    fn one(&self, layer: &Layer, scheme: Scheme) -> Result<StoredWeights> {
        let w = &layer.weights;
        if scheme >= w.scheme() {
            return Ok(w.clone());
        }
        let factor = self.calibration.filter(|_| scheme < Scheme::F16).and_then(|c| c.factor(&layer.name, w.cols));
        match factor {
            Some(r) => nearest_plane::round_for(&w.to_f32(), w.rows, w.cols, scheme, &r),
            None => round(&w.to_f32(), w.rows, w.cols, scheme),
        }
    }

    /// Every layer at its scheme of `schemes`.
    fn all(&self, schemes: &BTreeMap<String, Scheme>) -> Result<Vec<(&'a Layer, StoredWeights)>> {
        self.layers.iter().map(|layer| Ok((layer, self.one(layer, schemes[&layer.name])?))).collect()
    }
}

/// Errors of quantising add up; what is quantised is to be quantised anew from the original.
fn refuse_twice(config: &Config, tensors: &Tensors<'_>, scheme: Scheme) -> Result<()> {
    let already = match &config.quantisation {
        Some(Quantisation { scheme: Scheme::I8 | Scheme::I4, .. }) => true,
        Some(Quantisation { scheme: Scheme::F16, .. }) => scheme == Scheme::F16,
        _ => {
            let mut weights = layers(tensors)?.into_iter();
            scheme == Scheme::F16 && weights.all(|layer| layer.weights.scheme() == Scheme::F16)
        }
    };
    let is = config.quantisation.as_ref().map_or(Scheme::F16, |q| q.scheme);
    if scheme == Scheme::F32 {
        return Err(argument("quantising to f32 makes no sense: choose f16, i8 or i4".to_owned()));
    }
    if already {
        return Err(argument(format!("it is quantised already, to {is}; quantise the bundle that it was made from")));
    }
    Ok(())
}

fn argument(message: String) -> Error {
    Error::new(ErrorKind::Argument, message)
}
