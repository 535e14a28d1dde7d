//! What the agent makes of what it hears: which reaction it calls for, frame by frame.
//!
//! h = gelu(W x + b) of a frame's features, both levels and the sensitivity; a layer of LSTM cells;
//! shares of the reactions = softmax(V c + d).

use crate::bundle::Tensors;
use crate::config::{AppraisalConfig, HearingConfig};
use crate::error::Result;
use crate::frame::BLOCK_FRAMES;
use crate::kernels::{Epilogue, Exec, Kernels, Matrix};
use crate::nn::Lstm;

/// What a frame has beside features: two levels and the sensitivity.
const BESIDE: usize = 3;

/// The network's weights.
#[derive(Debug)]
pub struct AppraisalWeights {
    into: Matrix,
    cells: Lstm,
    out: Matrix,
}

impl AppraisalWeights {
    /// Reads `appraisal.into`, `appraisal.lstm` and `appraisal.out`.
    ///
    /// # Errors
    /// As [`Tensors::linear`].
    pub fn load(t: &Tensors<'_>, kernels: Kernels, config: &HearingConfig) -> Result<Self> {
        let AppraisalConfig { width: w, reactions } = &config.appraisal;
        Ok(Self {
            into: t.linear(kernels, "appraisal.into", *w, &[config.audio.features + BESIDE])?,
            cells: Lstm::load(t, kernels, "appraisal.lstm", *w)?,
            out: t.linear(kernels, "appraisal.out", reactions.len(), &[*w])?,
        })
    }

    /// Bytes of the packed matrices.
    pub fn bytes(&self) -> usize {
        [&self.into, self.cells.matrix(), &self.out].map(Matrix::bytes).into_iter().sum()
    }

    /// The widest row of an operation.
    pub fn width(config: &HearingConfig) -> usize {
        let AppraisalConfig { width, reactions } = &config.appraisal;
        (4 * width).max(reactions.len()).max(config.audio.features + BESIDE)
    }
}

/// One session's: what it remembers, and scratch.
#[derive(Debug)]
pub(super) struct Appraisal {
    /// `[4, features + 3]`.
    rows: Vec<f32>,
    /// `[4, width]`.
    h: Vec<f32>,
    scratch: Vec<f32>,
    /// The cells', `[2 width]`.
    memory: Vec<f32>,
    /// `[4, reactions]`.
    shares: Vec<f32>,
    /// Which of the reactions is none.
    none: Option<usize>,
}

impl Appraisal {
    /// One that has heard nothing.
    pub(super) fn new(config: &HearingConfig) -> Self {
        let AppraisalConfig { width, reactions } = &config.appraisal;
        let (width, reactions, inputs) = (*width, reactions.len(), config.audio.features + BESIDE);
        let zeros = |n| vec![0.0; n];
        Self {
            rows: zeros(BLOCK_FRAMES * inputs),
            h: zeros(BLOCK_FRAMES * width),
            scratch: zeros(Lstm::SCRATCH * width),
            memory: zeros(2 * width),
            shares: zeros(BLOCK_FRAMES * reactions),
            none: config.appraisal.reactions.iter().position(|name| name == AppraisalConfig::NONE),
        }
    }

    /// Forgets what was heard.
    pub(super) fn forget(&mut self) {
        self.memory.fill(0.0);
    }

    /// Appraises a block: features `[4, features]`, levels `[4, 2]`, sensitivity.
    pub(super) fn hear(
        &mut self,
        exec: &mut Exec,
        weights: &AppraisalWeights,
        features: &[f32],
        levels: &[f32],
        sensitivity: f32,
    ) {
        let Self { rows, h, scratch, memory, shares, .. } = self;
        let (inputs, width) = (rows.len() / BLOCK_FRAMES, h.len() / BLOCK_FRAMES);
        let frames = features.chunks_exact(inputs - BESIDE).zip(levels.chunks_exact(2));
        for (row, (features, levels)) in rows.chunks_exact_mut(inputs).zip(frames) {
            let (first, rest) = row.split_at_mut(features.len());
            first.copy_from_slice(features);
            rest[..2].copy_from_slice(levels);
            rest[2] = sensitivity;
        }
        exec.linear(&weights.into, rows, BLOCK_FRAMES, h, Epilogue::Gelu);
        for h in h.chunks_exact_mut(width) {
            weights.cells.step(exec, scratch, h, &mut [&mut memory[..]], |memory| Some(memory));
        }
        exec.linear(&weights.out, h, BLOCK_FRAMES, shares, Epilogue::Store);
        let reactions = shares.len() / BLOCK_FRAMES;
        shares.chunks_exact_mut(reactions).for_each(softmax);
    }

    /// Shares of the reactions in the frames that were appraised last, `[4, reactions]`.
    pub(super) fn shares(&self) -> &[f32] {
        &self.shares
    }

    /// How much of them, 0 to 1, is for a reaction at all.
    pub(super) fn reaction(&self) -> f32 {
        let Some(none) = self.none else { return 0.0 };
        let rows = self.shares.chunks_exact(self.shares.len() / BLOCK_FRAMES);
        rows.map(|row| 1.0 - row[none]).sum::<f32>() / BLOCK_FRAMES as f32
    }
}

fn softmax(row: &mut [f32]) {
    let top = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut sum = 0.0;
    for v in row.iter_mut() {
        *v = libm::expf(*v - top);
        sum += *v;
    }
    row.iter_mut().for_each(|v| *v /= sum);
}
