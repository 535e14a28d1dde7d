//! The audio encoder on tract-core: the same network, built from tract's own operators.
//!
//! Each convolution's left context is an input and an output of the model, so a run is a pure
//! function of samples and state. tract allocates whenever it runs, so sessions use
//! [`super::AudioEncoder`] by default; this one is the independent answer that ours is tested
//! against, and an alternative where allocation does not matter.

use super::weights::{LayerWeights, check_weights};
use crate::config::{AudioConfig, ConvConfig};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES};
use std::sync::Arc;
use tract_core::internal::*;
use tract_core::ops::array::{Slice, TypedConcat};
use tract_core::ops::cnn::{Conv, KernelFormat, PaddingSpec, PoolSpec};
use tract_core::ops::einsum::EinSum;
use tract_core::ops::math;
use tract_core::ops::nn::DataFormat;

/// The encoder for one voice on tract-core.
pub struct TractEncoder {
    plan: Arc<TypedSimplePlan>,
    /// Left contexts of the layers that have one, `[kernel - stride, inputs]` each.
    state: Vec<TValue>,
    features: usize,
}

impl TractEncoder {
    /// Builds the network, at the start of a signal. Weights of every scheme are computed with as
    /// floats.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when config and weights disagree or tract refuses the network.
    pub fn new(config: &AudioConfig, layers: &[LayerWeights<'_>], out: LayerWeights<'_>) -> Result<Self> {
        check_weights(config, layers, &out)?;
        let plan = build(config, layers, out).map_err(failed)?;
        let mut encoder = Self { plan, state: Vec::new(), features: config.features };
        encoder.reset()?;
        Ok(encoder)
    }

    fn zeros(&self) -> TractResult<Vec<TValue>> {
        let inputs = self.plan.model().input_outlets()?.iter().skip(1);
        inputs
            .map(|&o| {
                let shape = self.plan.model().outlet_fact(o)?.shape.as_concrete().context("shapes are fixed")?.to_vec();
                Ok(Tensor::zero::<f32>(&shape)?.into_tvalue())
            })
            .collect()
    }

    /// Back to the start of a signal: zeros on the left.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when tract cannot make a tensor of zeros.
    pub fn reset(&mut self) -> Result<()> {
        self.state = self.zeros().map_err(failed)?;
        Ok(())
    }

    /// As [`super::AudioEncoder::encode`], for whole blocks: `samples` is a multiple of 3200, `out`
    /// is row-major `[samples.len() / 800, features]`. Allocates.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] when tract fails to run the network; the state is then at the
    /// last whole block.
    ///
    /// # Panics
    /// When lengths disagree.
    pub fn encode(&mut self, samples: &[f32], out: &mut [f32]) -> Result<()> {
        assert!(samples.len().is_multiple_of(BLOCK_SAMPLES), "encode: whole blocks of {BLOCK_SAMPLES} samples");
        let features = BLOCK_FRAMES * self.features;
        assert_eq!(out.len(), samples.len() / BLOCK_SAMPLES * features, "encode: one feature vector a frame");
        for (samples, out) in samples.chunks(BLOCK_SAMPLES).zip(out.chunks_mut(features)) {
            self.block(samples, out).map_err(failed)?;
        }
        Ok(())
    }

    fn block(&mut self, samples: &[f32], out: &mut [f32]) -> TractResult<()> {
        let mut inputs = tvec!(Tensor::from_shape(&[BLOCK_SAMPLES, 1], samples)?.into_tvalue());
        inputs.extend(self.state.iter().cloned());
        let mut outputs = self.plan.run(inputs)?.into_iter();
        let first = outputs.next().context("the model has outputs")?;
        let features = first.to_plain_array_view::<f32>()?;
        for (to, from) in out.iter_mut().zip(features.iter()) {
            *to = *from;
        }
        self.state = outputs.collect();
        Ok(())
    }
}

fn failed(e: TractError) -> Error {
    Error::new(ErrorKind::BundleInvalid, format!("tract cannot run the audio encoder: {e:#}; use the built-in one"))
}

fn build(
    config: &AudioConfig,
    layers: &[LayerWeights<'_>],
    out: LayerWeights<'_>,
) -> TractResult<Arc<TypedSimplePlan>> {
    let mut model = TypedModel::default();
    let mut x = model.add_source("samples", f32::fact([BLOCK_SAMPLES, 1]))?;
    let mut rows = BLOCK_SAMPLES;
    let mut states = vec![];
    for (i, (conv, layer)) in config.layers.iter().zip(layers).enumerate() {
        let name = format!("conv.{i}");
        let context = conv.kernel - conv.stride;
        let mut padded = x;
        if context > 0 {
            let state = model.add_source(format!("{name}.state"), f32::fact([context, conv.inputs]))?;
            padded = model.wire_node(format!("{name}.padded"), TypedConcat::new(0), &[state, x])?[0];
            let last = Slice::new(0, rows, rows + context);
            states.push(model.wire_node(format!("{name}.next"), last, &[padded])?[0]);
        }
        let y = convolution(&mut model, &name, conv, layer, padded)?;
        let y = gelu(&mut model, &name, y)?;
        x = if conv.residual { model.wire_node(format!("{name}.residual"), math::add(), &[y, x])?[0] } else { y };
        rows /= conv.stride;
    }
    let weights = Tensor::from_shape(&[out.weights.rows, out.weights.cols], &out.weights.to_f32())?;
    let weights = model.add_const("out.weight", weights)?;
    let bias = model.add_const("out.bias", Tensor::from_shape(&[1, out.bias.len()], out.bias)?)?;
    let product = EinSum::new("tc,oc->to".parse()?, f32::datum_type());
    let y = model.wire_node("out.product", product, &[x, weights])?;
    let y = model.wire_node("out", math::add(), &[y[0], bias])?;
    let outlets: Vec<_> = y.into_iter().chain(states).collect();
    model.select_output_outlets(&outlets)?;
    model.into_optimized()?.into_runnable()
}

/// Time-major convolution without padding: `[rows, inputs]` to `[(rows - kernel) / stride + 1,
/// outputs]`.
fn convolution(
    model: &mut TypedModel,
    name: &str,
    conv: &ConvConfig,
    layer: &LayerWeights<'_>,
    x: OutletId,
) -> TractResult<OutletId> {
    let kernel = Tensor::from_shape(&[conv.outputs, conv.kernel, conv.inputs], &layer.weights.to_f32())?;
    let kernel = model.add_const(format!("{name}.weight"), kernel)?;
    let bias = model.add_const(format!("{name}.bias"), tensor1(layer.bias))?;
    let op = Conv {
        pool_spec: PoolSpec {
            data_format: DataFormat::HWC,
            kernel_shape: tvec!(conv.kernel),
            padding: PaddingSpec::Valid,
            dilations: None,
            strides: Some(tvec!(conv.stride)),
            input_channels: conv.inputs,
            output_channels: conv.outputs,
        },
        kernel_fmt: KernelFormat::OHWI,
        group: 1,
        q_params: None,
    };
    Ok(model.wire_node(name, op, &[x, kernel, bias])?[0])
}

/// `x / 2 (1 + tanh(sqrt(2 / pi) (x + 0.044715 x^3)))`.
fn gelu(model: &mut TypedModel, name: &str, x: OutletId) -> TractResult<OutletId> {
    let number = |model: &mut TypedModel, what: &str, value: f32| {
        model.add_const(format!("{name}.gelu.{what}"), Tensor::from_shape(&[1, 1], &[value])?)
    };
    let cubic = number(model, "cubic", 0.044_715)?;
    let scale = number(model, "scale", (2.0 / std::f32::consts::PI).sqrt())?;
    let one = number(model, "one", 1.0)?;
    let half = number(model, "half", 0.5)?;
    let mut step = 0;
    let mut wire = |op: Box<dyn TypedOp>, inputs: &[OutletId]| -> TractResult<OutletId> {
        step += 1;
        Ok(model.wire_node(format!("{name}.gelu.{step}"), op, inputs)?[0])
    };
    let square = wire(Box::new(math::mul()), &[x, x])?;
    let square = wire(Box::new(math::mul()), &[square, cubic])?;
    let factor = wire(Box::new(math::add()), &[square, one])?;
    let inner = wire(Box::new(math::mul()), &[x, factor])?;
    let inner = wire(Box::new(math::mul()), &[inner, scale])?;
    let tanh = wire(Box::new(math::tanh()), &[inner])?;
    let gate = wire(Box::new(math::add()), &[tanh, one])?;
    let halved = wire(Box::new(math::mul()), &[x, half])?;
    wire(Box::new(math::mul()), &[halved, gate])
}
