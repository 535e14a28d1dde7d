//! The audio encoders' weights as a bundle holds them.

use super::{StoredWeights, Tensors};
use crate::audio::{AudioWeights, LayerWeights};
use crate::config::AudioConfig;
use crate::error::Result;
use crate::kernels::Kernels;

/// Weights and biases of the audio encoder in their scheme; what both backends are made from.
#[derive(Debug)]
pub struct AudioSource {
    layers: Vec<Plain>,
    out: Plain,
    prefix: &'static str,
}

#[derive(Debug)]
struct Plain {
    weight: StoredWeights,
    bias: Vec<f32>,
}

impl AudioSource {
    /// Reads `{prefix}.conv.*` (`[outputs, kernel, inputs]`) and `{prefix}.out` (`[features,
    /// last]`); prefixes are `audio`, of voices, and `hearing`.
    ///
    /// # Errors
    /// As [`Tensors::weights`].
    pub fn load(t: &Tensors<'_>, config: &AudioConfig, prefix: &'static str) -> Result<Self> {
        let conv = |(i, c): (usize, &crate::config::ConvConfig)| {
            Plain::load(t, &format!("{prefix}.conv.{i}"), &[c.outputs, c.kernel, c.inputs])
        };
        let last = config.layers.last().map_or(1, |c| c.outputs);
        Ok(Self {
            layers: config.layers.iter().enumerate().map(conv).collect::<Result<_>>()?,
            out: Plain::load(t, &format!("{prefix}.out"), &[config.features, last])?,
            prefix,
        })
    }

    /// Packs the weights for our kernels.
    ///
    /// # Errors
    /// As [`AudioWeights::new`].
    pub fn pack(&self, kernels: Kernels, config: &AudioConfig) -> Result<AudioWeights> {
        AudioWeights::new(&kernels, config, self.prefix, &self.borrow(), self.out.borrow())
    }

    /// Builds the network on tract.
    ///
    /// # Errors
    /// As [`crate::audio::TractEncoder::new`].
    #[cfg(feature = "tract")]
    pub fn tract(&self, config: &AudioConfig) -> Result<crate::audio::TractEncoder> {
        crate::audio::TractEncoder::new(config, &self.borrow(), self.out.borrow())
    }

    fn borrow(&self) -> Vec<LayerWeights<'_>> {
        self.layers.iter().map(Plain::borrow).collect()
    }
}

impl Plain {
    fn load(t: &Tensors<'_>, name: &str, shape: &[usize]) -> Result<Self> {
        Ok(Self { weight: t.weights(name, shape[0], &shape[1..])?, bias: t.f32(&format!("{name}.bias"), &shape[..1])? })
    }

    fn borrow(&self) -> LayerWeights<'_> {
        LayerWeights { weights: self.weight.borrow(), bias: &self.bias }
    }
}
