//! All of a session that changes from block to block.

use super::SessionOptions;
use super::fallback::Fallback;
use super::inputs::Inputs;
use super::maker::Maker;
use super::tools::{Kit, Tools};
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, Frame, Sampler};
use crate::kernels::Exec;
use crate::normaliser::Standardised;
use crate::pose;

/// All that changes from block to block.
pub(super) struct BlockState {
    pub(super) inputs: Inputs,
    pub(super) maker: Maker,
    /// What makes motion instead of `maker` rather than that a pose is held.
    pub(super) fallback: Option<Box<Fallback>>,
    pub(super) motion: pose::Decoder,
    /// The rig's head.
    pub(super) head: usize,
    pub(super) frames: Vec<Frame>,
    /// The next block.
    pub(super) block: u64,
}

impl BlockState {
    /// All memory; [`BlockState::reset`] makes it a start.
    pub(super) fn new(exec: &mut Exec, engine: &Engine, options: &SessionOptions) -> Result<Self> {
        let maker = Maker::new(exec, engine, options)?;
        let rig = &engine.config.rig;
        let mut motion = pose::Decoder::new(engine.kernels, rig, engine.config.pose.radius);
        if options.diagnostics.bridge && engine.config.session.bridge > 0.0 {
            motion = motion.with_bridge(rig, engine.config.session.bridge);
        }
        if options.guard {
            motion = motion.with_guard();
        }
        if options.stance {
            motion = motion.with_stance(rig);
        }
        let dyadic = if engine.config.dram.is_some() { rig.joints.len() } else { 0 };
        let frame = || Frame { dyadic: vec![0.0; dyadic], ..Frame::empty(rig.joints.len()) };
        Ok(Self {
            inputs: Inputs::new(engine, options)?,
            maker,
            fallback: None,
            motion,
            head: rig.index("head").unwrap_or(0),
            frames: (0..BLOCK_FRAMES).map(|_| frame()).collect(),
            block: 0,
        })
    }

    /// Back to the start: the idle clip as history (`idle`: its latents, where there are any), the
    /// agent where the options put it.
    pub(super) fn reset(&mut self, tools: &mut Tools<'_>, options: &SessionOptions, idle: Standardised<&[f32]>) {
        self.block = options.diagnostics.first_block;
        self.inputs.reset(self.block);
        self.motion.reset(options.start);
        self.leave_fallback();
        let Self { inputs, maker, motion, frames, block, .. } = self;
        match (maker, tools.kit()) {
            (Maker::Latent(maker), Kit::Sarah(mut tools)) => {
                maker.reset(&mut tools, options, idle, *block, &inputs.condition, motion);
            }
            (Maker::Step(maker), Kit::Dram(tools)) => maker.reset(tools.model, motion, frames),
            _ => {}
        }
    }

    /// Another than the fallback makes the next block; whether the fallback made the last.
    pub(super) fn leave_fallback(&mut self) -> bool {
        let left = self.fallback.as_mut().is_some_and(|fallback| fallback.leave());
        if left {
            // Whom joints follow is not told by others.
            self.frames.iter_mut().for_each(|frame| frame.dyadic.clear());
        }
        left
    }

    pub(super) fn supports(&self, sampler: Sampler) -> bool {
        self.maker.supports(sampler)
    }
}
