//! The featherweight tier as what a session of the flow model steps down to instead of holding its
//! pose.

use super::argument;
use super::by_step::ByStep;
use super::inputs::{Ear, Inputs};
use super::tools::{DramTools, Kit, Tools, Workspace};
use crate::engine::{Engine, Model};
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, Frame};
use crate::kernels::Exec;
use crate::pose;
use std::sync::Arc;

/// Another engine's predictors, with all that it takes to step them.
pub(super) struct Fallback {
    engine: Arc<Engine>,
    exec: Exec,
    work: Workspace,
    maker: ByStep,
    ears: [Ear; 2],
    /// Whether it made the last block.
    active: bool,
}

impl Fallback {
    /// For sessions of the engine `own`.
    pub(super) fn new(own: &Engine, engine: &Arc<Engine>) -> Result<Self> {
        let Model::Dram(dram) = &engine.model else {
            return Err(argument("a fallback is an engine of the kind `dram`; this one is not"));
        };
        let (a, b) = (&own.config, &engine.config);
        if a.rig != b.rig {
            return Err(argument(
                "a fallback has the rig of the session's engine; export both bundles from one corpus",
            ));
        }
        if (a.user_delay_blocks, a.agent_delay_blocks) != (b.user_delay_blocks, b.agent_delay_blocks) {
            return Err(argument(
                "a fallback has the delays of the session's engine; export both bundles with the same",
            ));
        }
        Ok(Self {
            exec: engine.exec(1)?,
            work: Workspace::new(engine, 1, 1),
            maker: ByStep::new(engine, dram),
            ears: [Ear::new(engine)?, Ear::new(engine)?],
            active: false,
            engine: Arc::clone(engine),
        })
    }

    /// Another makes the next block; whether this one made the last.
    pub(super) fn leave(&mut self) -> bool {
        std::mem::take(&mut self.active)
    }

    /// Makes the frames of `block`, which was decided on with gaze target `gaze`; `first` is the
    /// session's first block.
    pub(super) fn make(
        &mut self,
        (block, first, gaze): (u64, u64, Option<f32>),
        inputs: &mut Inputs,
        motion: &mut pose::Decoder,
        frames: &mut [Frame],
    ) -> Result<()> {
        let Self { engine, exec, work, maker, ears, active } = self;
        let mut tools = Tools { exec, work, engine };
        let Kit::Dram(DramTools { exec, work, model }) = tools.kit() else { return Ok(()) };
        if !std::mem::replace(active, true) {
            ears.iter_mut().for_each(Ear::close);
            model.restart(&mut maker.state);
            if block > first {
                maker.go_on(model, motion);
            }
            motion.cross_fade();
        }
        let heard = inputs.lend(exec, engine, block, ears)?;
        maker.begin(motion.root(), heard, inputs.seen(block, gaze));
        for frame in 0..BLOCK_FRAMES {
            let voices = ears.each_ref().map(|ear| ear.features.as_slice());
            model.step(exec, work, &mut [&mut *maker], frame, |maker| Some(maker.agent(voices)));
        }
        let joints = engine.config.rig.len();
        frames.iter_mut().for_each(|frame| frame.dyadic.resize(joints, 0.0));
        maker.pose(model, motion, None, frames)
    }
}
