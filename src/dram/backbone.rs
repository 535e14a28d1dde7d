//! A predictor's layers, a step of several agents at once.
//!
//! Each agent is a row. A layer's convolution of two taps, `dilation` frames apart, is a product of
//! the two rows side by side: the earlier one comes out of the agent's ring, whose place the later
//! one takes. So a pass over the weights serves all agents, and a stream needs no other kernel.

use crate::bundle::Tensors;
use crate::config::{LstmConfig, TcnConfig};
use crate::error::Result;
use crate::kernels::{Epilogue, Exec, Kernels, Matrix};
use crate::nn::Lstm;

/// Layers between the first and the last.
#[derive(Debug)]
enum Layers {
    Tcn(Vec<Residual>),
    Lstm(Vec<Lstm>),
}

/// h + fc(gelu(conv(h))).
#[derive(Debug)]
struct Residual {
    conv: Matrix,
    fc: Matrix,
    dilation: usize,
    /// Where its ring lies in the memory.
    at: usize,
}

/// A predictor.
#[derive(Debug)]
pub(super) struct Backbone {
    into: Matrix,
    layers: Layers,
    out: Matrix,
    width: usize,
}

/// Scratch of steps.
#[derive(Debug)]
pub(super) struct Scratch {
    h: Vec<f32>,
    inner: Vec<f32>,
}

impl Scratch {
    /// For up to `agents` rows of any of these.
    pub(super) fn new(backbones: [&Backbone; 2], agents: usize) -> Self {
        let width = backbones.map(|b| b.width).into_iter().max().unwrap_or(0);
        let [h, inner] = [1, Lstm::SCRATCH].map(|n| vec![0.0; agents * n * width]);
        Self { h, inner }
    }
}

impl Backbone {
    /// Reads `{name}.into`, `{name}.conv.*` and `{name}.fc.*`, `{name}.out`.
    pub(super) fn tcn(
        t: &Tensors<'_>,
        kernels: Kernels,
        name: &str,
        [inputs, outputs]: [usize; 2],
        c: &TcnConfig,
    ) -> Result<Self> {
        let w = c.width;
        let mut at = 0;
        let layer = |(i, &dilation): (usize, &usize)| {
            let from = at;
            at += dilation * w;
            Ok(Residual {
                conv: t.linear(kernels, &format!("{name}.conv.{i}"), w, &[2, w])?,
                fc: t.linear(kernels, &format!("{name}.fc.{i}"), w, &[w])?,
                dilation,
                at: from,
            })
        };
        let layers = c.dilations.iter().enumerate().map(layer).collect::<Result<_>>()?;
        Self::around(t, kernels, name, [inputs, outputs], w, Layers::Tcn(layers))
    }

    /// Reads `{name}.into`, `{name}.lstm.*`, `{name}.out`.
    pub(super) fn lstm(
        t: &Tensors<'_>,
        kernels: Kernels,
        name: &str,
        [inputs, outputs]: [usize; 2],
        c: &LstmConfig,
    ) -> Result<Self> {
        let layer = |i| Lstm::load(t, kernels, &format!("{name}.lstm.{i}"), c.width);
        let layers = (0..c.layers).map(layer).collect::<Result<_>>()?;
        Self::around(t, kernels, name, [inputs, outputs], c.width, Layers::Lstm(layers))
    }

    fn around(
        t: &Tensors<'_>,
        kernels: Kernels,
        name: &str,
        [inputs, outputs]: [usize; 2],
        width: usize,
        layers: Layers,
    ) -> Result<Self> {
        Ok(Self {
            into: t.linear(kernels, &format!("{name}.into"), width, &[inputs])?,
            layers,
            out: t.linear(kernels, &format!("{name}.out"), outputs, &[width])?,
            width,
        })
    }

    fn matrices(&self) -> impl Iterator<Item = &Matrix> {
        let (residual, lstm) = match &self.layers {
            Layers::Tcn(layers) => (layers.as_slice(), &[][..]),
            Layers::Lstm(layers) => (&[][..], layers.as_slice()),
        };
        let inner = residual.iter().flat_map(|layer| [&layer.conv, &layer.fc]).chain(lstm.iter().map(Lstm::matrix));
        [&self.into, &self.out].into_iter().chain(inner)
    }

    /// Bytes of the packed matrices, all of which a step reads.
    pub(super) fn bytes(&self) -> usize {
        self.matrices().map(Matrix::bytes).sum()
    }

    /// Multiply-adds of a step.
    pub(super) fn products(&self) -> usize {
        self.matrices().map(|m| m.in_features() * m.out_features()).sum()
    }

    /// Length of an input row.
    pub(super) fn inputs(&self) -> usize {
        self.into.in_features()
    }

    /// Values that one agent's memory has.
    pub(super) fn memory(&self) -> usize {
        match &self.layers {
            Layers::Tcn(layers) => layers.iter().map(|layer| layer.dilation * self.width).sum(),
            Layers::Lstm(layers) => 2 * layers.len() * self.width,
        }
    }

    /// One step of `n` agents: `x` `[n, inputs]` to `y` `[n, outputs]`. `memory` gives the number
    /// of the frame and the memory of each member that has a row, in order.
    pub(super) fn step<M>(
        &self,
        exec: &mut Exec,
        scratch: &mut Scratch,
        x: &[f32],
        y: &mut [f32],
        members: &mut [M],
        memory: impl for<'a> Fn(&'a mut M) -> Option<(u64, &'a mut [f32])> + Copy,
    ) {
        let (w, n) = (self.width, x.len() / self.inputs());
        let h = &mut scratch.h[..n * w];
        match &self.layers {
            Layers::Tcn(layers) => {
                exec.linear(&self.into, x, n, h, Epilogue::Store);
                let (pair, inner) = scratch.inner[..3 * n * w].split_at_mut(2 * n * w);
                for layer in layers {
                    let rows = pair.chunks_exact_mut(2 * w).zip(h.chunks_exact(w));
                    for ((frame, memory), (pair, h)) in members.iter_mut().filter_map(memory).zip(rows) {
                        let slot = layer.at + (frame % layer.dilation as u64) as usize * w;
                        let past = &mut memory[slot..slot + w];
                        pair[..w].copy_from_slice(past);
                        pair[w..].copy_from_slice(h);
                        past.copy_from_slice(h);
                    }
                    exec.linear(&layer.conv, pair, n, inner, Epilogue::Gelu);
                    exec.linear(&layer.fc, inner, n, h, Epilogue::Add);
                }
            }
            Layers::Lstm(layers) => {
                exec.linear(&self.into, x, n, h, Epilogue::Gelu);
                for (i, layer) in layers.iter().enumerate() {
                    layer.step(exec, &mut scratch.inner, h, members, |member| {
                        memory(member).map(|(_, memory)| &mut memory[2 * i * w..2 * (i + 1) * w])
                    });
                }
            }
        }
        exec.linear(&self.out, h, n, y, Epilogue::Store);
    }
}
