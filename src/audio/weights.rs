//! Weights of an audio encoder: checked against the configuration, packed for the CPU.

use crate::config::{AudioConfig, ConvConfig};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::FRAME_SAMPLES;
use crate::kernels::{Kernels, Matrix, Weights};

/// One layer as a bundle holds it.
#[derive(Debug, Clone, Copy)]
pub struct LayerWeights<'a> {
    /// Convolution: `[outputs, kernel, inputs]`, so that a row is a window of time-major input;
    /// output layer: `[features, last]`.
    pub weights: Weights<'a>,
    /// One value an output.
    pub bias: &'a [f32],
}

impl LayerWeights<'_> {
    fn check(&self, what: &str, rows: usize, cols: usize) -> Result<()> {
        let Weights { rows: r, cols: c, .. } = self.weights;
        if (r, c, self.bias.len()) == (rows, cols, rows) && self.weights.is_complete() {
            return Ok(());
        }
        Err(invalid(format!(
            "{what}: weights of {r} x {c} and {} biases where the config asks for {rows} x {cols} and {rows}",
            self.bias.len()
        )))
    }
}

/// Packed weights of an audio encoder; immutable, shared by all that it listens to and by all
/// sessions.
#[derive(Debug)]
pub struct AudioWeights {
    pub(super) layers: Vec<(ConvConfig, Matrix)>,
    pub(super) out: Matrix,
}

impl AudioWeights {
    /// Checks and packs `layers` (first to last) and the output layer of the encoder `prefix`.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] as [`check_audio_config`], and when weights and config
    /// disagree.
    pub fn new(
        kernels: &Kernels,
        config: &AudioConfig,
        prefix: &str,
        layers: &[LayerWeights<'_>],
        out: LayerWeights<'_>,
    ) -> Result<Self> {
        check_weights(config, layers, &out)?;
        let pack = |name: &str, l: &LayerWeights<'_>| kernels.pack(l.weights, Some(l.bias)).named(name);
        let layers = config.layers.iter().zip(layers).enumerate();
        Ok(Self {
            layers: layers.map(|(i, (conv, l))| (*conv, pack(&format!("{prefix}.conv.{i}"), l))).collect(),
            out: pack(&format!("{prefix}.out"), &out),
        })
    }

    /// Width of a feature vector.
    pub fn features(&self) -> usize {
        self.out.out_features()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.layers.iter().map(|(_, m)| m.bytes()).sum::<usize>() + self.out.bytes()
    }
}

/// Refuses weights that do not fit `config`.
pub(super) fn check_weights(config: &AudioConfig, layers: &[LayerWeights<'_>], out: &LayerWeights<'_>) -> Result<()> {
    check_audio_config(config)?;
    if layers.len() != config.layers.len() {
        let (have, want) = (layers.len(), config.layers.len());
        return Err(invalid(format!("{have} convolutions where the config lists {want}")));
    }
    for (i, (conv, layer)) in config.layers.iter().zip(layers).enumerate() {
        layer.check(&format!("audio.conv.{i}"), conv.outputs, conv.kernel * conv.inputs)?;
    }
    out.check("audio.out", config.features, config.layers.last().map_or(0, |c| c.outputs))
}

/// Refuses layer lists that are not one vector a frame of 800 mono samples.
///
/// # Errors
/// [`ErrorKind::BundleInvalid`], naming the layer: strides that do not multiply to 800, a kernel
/// shorter than its stride, channels that do not connect, sizes of 0 or beyond 65536, a residual
/// layer that changes the shape.
pub fn check_audio_config(config: &AudioConfig) -> Result<()> {
    const MOST: usize = 1 << 16;
    let size = |what: String, n: usize| match n {
        1..=MOST => Ok(()),
        _ => Err(invalid(format!("{what} is {n}, outside 1 to {MOST}"))),
    };
    let (mut channels, mut left) = (1, FRAME_SAMPLES);
    for (i, conv) in config.layers.iter().enumerate() {
        let ConvConfig { inputs, outputs, kernel, stride, residual } = *conv;
        for (what, n) in [("inputs", inputs), ("outputs", outputs), ("kernel", kernel), ("stride", stride)] {
            size(format!("audio.layers[{i}].{what}"), n)?;
        }
        size(format!("audio.layers[{i}].kernel * inputs"), kernel.saturating_mul(inputs))?;
        if inputs != channels {
            return Err(invalid(format!("audio.layers[{i}] takes {inputs} channels of {channels} that come in")));
        }
        if kernel < stride {
            return Err(invalid(format!("audio.layers[{i}]: kernel {kernel} is shorter than stride {stride}")));
        }
        if residual && (stride != 1 || inputs != outputs) {
            return Err(invalid(format!("audio.layers[{i}] is residual: it needs stride 1 and equal channels")));
        }
        if !left.is_multiple_of(stride) {
            return Err(invalid(format!("audio.layers: strides do not multiply to {FRAME_SAMPLES}")));
        }
        (channels, left) = (outputs, left / stride);
    }
    if left != 1 {
        return Err(invalid(format!("audio.layers: strides do not multiply to {FRAME_SAMPLES}")));
    }
    size("audio.features".into(), config.features)
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::BundleInvalid, format!("{message}; export the bundle again"))
}
