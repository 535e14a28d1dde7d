//! The audio encoder on our own kernels: a stack of causal strided convolutions, one feature vector
//! per frame.
//!
//! Signals are time-major rows of channels, so a window of `kernel` rows is `kernel * inputs`
//! contiguous floats, and a convolution over `n` outputs is a product of `n` such windows with
//! `[outputs, kernel * inputs]`. A layer keeps the last `kernel - stride` rows of its input: the
//! left context of the next call, zeros at the start. Every output row is computed from the same
//! numbers in the same order however the signal is cut, so any cutting gives the same bits.

use super::weights::AudioWeights;
use crate::config::{AudioConfig, ConvConfig};
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, FRAME_SAMPLES};
use crate::kernels::{Epilogue, Exec};

/// Windows that are gathered at once.
const GATHER: usize = 64;

/// One layer's input: its left context, then the rows of the frames at hand.
struct Input {
    conv: ConvConfig,
    /// Rows of left context, `kernel - stride`.
    context: usize,
    /// Rows a frame.
    rows: usize,
    /// `(context + 4 * rows) * inputs` floats.
    data: Vec<f32>,
}

impl Input {
    /// The floats of the first `frames` frames after the context.
    fn fresh(&mut self, frames: usize) -> &mut [f32] {
        let from = self.context * self.conv.inputs;
        &mut self.data[from..from + frames * self.rows * self.conv.inputs]
    }
}

/// The encoder's state for one voice: left contexts and scratch. Allocates when made and never
/// after.
pub struct AudioEncoder {
    inputs: Vec<Input>,
    /// Input of the output layer, 4 frames.
    hidden: Vec<f32>,
    windows: Vec<f32>,
}

impl AudioEncoder {
    /// An encoder at the start of a signal.
    ///
    /// # Errors
    /// As [`super::check_audio_config`].
    pub fn new(config: &AudioConfig) -> Result<Self> {
        super::check_audio_config(config)?;
        let mut rows = FRAME_SAMPLES;
        let mut inputs = Vec::new();
        for &conv in &config.layers {
            let context = conv.kernel - conv.stride;
            let data = vec![0.0; (context + BLOCK_FRAMES * rows) * conv.inputs];
            inputs.push(Input { conv, context, rows, data });
            rows /= conv.stride;
        }
        let last = config.layers.last().map_or(1, |c| c.outputs);
        let window = config.layers.iter().map(|c| c.kernel * c.inputs).max().unwrap_or(0);
        Ok(Self { inputs, hidden: vec![0.0; BLOCK_FRAMES * last], windows: vec![0.0; GATHER * window] })
    }

    /// The width that an [`Exec`] must have to run this encoder.
    pub fn width(config: &AudioConfig) -> usize {
        let widths = config.layers.iter().map(|c| (c.kernel * c.inputs).max(c.outputs));
        widths.max().unwrap_or(1).max(config.features)
    }

    /// Back to the start of a signal: zeros on the left.
    pub fn reset(&mut self) {
        for input in &mut self.inputs {
            input.data.fill(0.0);
        }
    }

    /// What it remembers of the signal so far.
    pub fn context(&self) -> Vec<f32> {
        self.inputs.iter().flat_map(|input| &input.data[..input.context * input.conv.inputs]).copied().collect()
    }

    /// Goes on from what an encoder of the same configuration remembered.
    ///
    /// # Panics
    /// When it is another configuration's.
    pub fn set_context(&mut self, context: &[f32]) {
        let mut rest = context;
        for input in &mut self.inputs {
            let own = &mut input.data[..input.context * input.conv.inputs];
            let (part, others) = rest.split_at(own.len());
            own.copy_from_slice(part);
            rest = others;
        }
        assert!(rest.is_empty(), "a context of this configuration");
    }

    /// Encodes `samples` (24 kHz mono, a multiple of 800), which follow those of the call before,
    /// into one feature vector a frame: `out` is row-major `[samples.len() / 800, features]`.
    /// Vector `t` depends on samples before `800 (t + 1)` only.
    ///
    /// # Panics
    /// When lengths disagree, or the weights are of another configuration.
    pub fn encode(&mut self, exec: &mut Exec, weights: &AudioWeights, samples: &[f32], out: &mut [f32]) {
        let features = weights.features();
        assert!(samples.len().is_multiple_of(FRAME_SAMPLES), "encode: whole frames of {FRAME_SAMPLES} samples");
        assert_eq!(out.len(), samples.len() / FRAME_SAMPLES * features, "encode: one feature vector a frame");
        assert_eq!(self.inputs.len(), weights.layers.len(), "encode: weights of this configuration");
        let pieces = samples.chunks(BLOCK_FRAMES * FRAME_SAMPLES);
        for (samples, out) in pieces.zip(out.chunks_mut(BLOCK_FRAMES * features)) {
            self.piece(exec, weights, samples, out);
        }
    }

    /// One to four frames.
    fn piece(&mut self, exec: &mut Exec, weights: &AudioWeights, samples: &[f32], out: &mut [f32]) {
        let frames = samples.len() / FRAME_SAMPLES;
        self.inputs[0].fresh(frames).copy_from_slice(samples);
        for (i, (conv, matrix)) in weights.layers.iter().enumerate() {
            let (done, rest) = self.inputs.split_at_mut(i + 1);
            let input = &mut done[i];
            assert_eq!(*conv, input.conv, "encode: weights of this configuration");
            let rows = frames * input.rows / conv.stride;
            let y = match rest.first_mut() {
                Some(next) => next.fresh(frames),
                None => &mut self.hidden[..rows * conv.outputs],
            };
            let (window, step) = (conv.kernel * conv.inputs, conv.stride * conv.inputs);
            if window == step {
                exec.linear(matrix, &input.data[..rows * window], rows, y, Epilogue::Gelu);
            } else {
                for (tile, y) in y.chunks_mut(GATHER * conv.outputs).enumerate() {
                    let count = y.len() / conv.outputs;
                    let windows = &mut self.windows[..count * window];
                    for (t, w) in windows.chunks_exact_mut(window).enumerate() {
                        w.copy_from_slice(&input.data[(tile * GATHER + t) * step..][..window]);
                    }
                    exec.linear(matrix, windows, count, y, Epilogue::Gelu);
                }
            }
            if conv.residual {
                for (y, x) in y.iter_mut().zip(input.fresh(frames)) {
                    *y += *x;
                }
            }
            let used = frames * input.rows * conv.inputs;
            input.data.copy_within(used..used + input.context * conv.inputs, 0);
        }
        let hidden = &self.hidden[..frames * weights.out.in_features()];
        exec.linear(&weights.out, hidden, frames, out, Epilogue::Store);
    }
}
