//! One session's block, stage by stage. What computes it is the [`pipeline`](super::pipeline).

use super::SessionOptions;
use super::governor::{Hold, Plan};
use super::inputs::{LISTENERS, Listening};
use super::maker::Maker;
use super::probe::{Probe, tell};
use super::rest;
use super::state::BlockState;
use super::tools::{DramTools, Kit, SarahTools, Tools};
use crate::dram::Agent;
use crate::engine::{Engine, Model};
use crate::error::Result;
use crate::flow::Generator;
use crate::frame::{BLOCK_FRAMES, FPS};
use crate::par::Pool;
use crate::pose::gaze_score;
use crate::vae::Decoding;

/// A session's next block.
pub(super) struct Block<'a> {
    pub(super) options: &'a SessionOptions,
    pub(super) plan: Plan,
    pub(super) state: &'a mut BlockState,
    /// Told about every stage.
    pub(super) probe: Option<&'a mut dyn Probe>,
    /// What has become of it so far; a block that failed is left where it is.
    pub(super) outcome: Result<()>,
}

/// A block whose frames are made of what was decoded, or missed.
pub(super) struct Posing<'a> {
    state: &'a mut BlockState,
    plan: &'a Plan,
    outcome: &'a mut Result<()>,
}

impl Block<'_> {
    /// Whether motion is computed for it, not held.
    pub(super) fn moves(&self) -> bool {
        self.plan.hold == Hold::No && self.outcome.is_ok()
    }

    /// What is to listen for it.
    pub(super) fn listening(&mut self) -> [Listening<'_>; LISTENERS] {
        let BlockState { inputs, frames, head, block, .. } = &mut *self.state;
        // The frames are those of the block before.
        inputs.listening(*block, std::array::from_fn(|i| frames[i].global[*head]), self.options.sensitivity)
    }

    /// Its generator of latents, if it has one.
    pub(super) fn generator(&mut self) -> Option<&mut Generator> {
        self.state.maker.latent().map(|maker| &mut maker.generator)
    }

    /// Its agent in a step, if it goes by steps.
    pub(super) fn agent(&mut self) -> Option<Agent<'_>> {
        let BlockState { maker, inputs, .. } = &mut *self.state;
        maker.step().map(|maker| maker.agent(inputs.voice_features()))
    }

    /// Leaves the block to the fallback, or holds the last pose, instead of computing motion;
    /// rehearses a step where the plan says so.
    pub(super) fn hold(&mut self, tools: &mut Tools<'_>) {
        let Self { options, plan, state, .. } = self;
        let steps = plan.hold.falls_back() && state.fallback.is_some();
        self.outcome = if steps { state.fall_back(options) } else { state.inputs.skip(state.block) };
        if self.outcome.is_err() {
            return;
        }
        if plan.hold.rehearses() {
            let BlockState { maker, inputs, motion, .. } = &mut **state;
            match (maker, tools.kit()) {
                (Maker::Latent(maker), Kit::Sarah(mut tools)) => maker.rehearse(&mut tools, inputs, plan.sampler),
                (Maker::Step(maker), Kit::Dram(mut tools)) => maker.rehearse(&mut tools, inputs, motion.root()),
                _ => {}
            }
        }
        if !steps {
            state.leave_fallback();
            state.motion.hold_block(&mut state.frames);
            state.frames.iter_mut().for_each(|frame| frame.dyadic.fill(0.0));
        }
        state.label(tools.engine, plan);
    }

    /// Makes the conditioning, for which voices have listened, and begins the latent or the steps.
    pub(super) fn begin(&mut self, engine: &Engine) {
        let Self { options, plan, state, probe, .. } = self;
        if state.leave_fallback() {
            state.motion.cross_fade();
        }
        let BlockState { maker, inputs, motion, block, .. } = &mut **state;
        let root = motion.root();
        match maker {
            Maker::Latent(maker) => {
                let gaze = engine.config.gaze.as_ref();
                let gaze = options.diagnostics.gaze_control.cue(gaze, options.gaze, plan.sampler, options.seed, *block);
                let rest = engine.config.rest.as_ref();
                let activity = |company| {
                    let drawn = |rest| rest::level(rest, plan.sampler, options.seed, *block, company);
                    rest.and_then(|rest| options.diagnostics.activity.or_else(|| drawn(rest)))
                };
                self.outcome = inputs.prepare(*block, &root, (gaze, &activity), options.sensitivity, probe);
                if self.outcome.is_err() {
                    return;
                }
                let temperature = options.temperature(&engine.config, plan.sampler);
                let guidance = options.guidance(engine, inputs.reaction());
                maker.generator.begin(plan.sampler, guidance, &inputs.condition, |token, eps| {
                    maker.noise.fill(options, temperature, token, eps);
                });
            }
            Maker::Step(maker) => match inputs.heard(*block, probe) {
                Ok(heard) => maker.begin(root, heard, inputs.seen(*block, options.gaze)),
                Err(error) => self.outcome = Err(error),
            },
        }
    }

    /// Tells about an evaluation of the network.
    pub(super) fn evaluated(&mut self) {
        if let (Some(probe), Some(maker)) = (&mut self.probe, self.state.maker.latent()) {
            probe.stage(self.state.block, "x1", maker.generator.x1());
        }
    }

    /// Tells about a step, row `i` of those that were made together.
    pub(super) fn stepped(&mut self, tools: &DramTools<'_>, i: usize) {
        if let (Some(probe), Some(maker)) = (&mut self.probe, self.state.maker.step()) {
            for (name, values) in tools.work.stages(i) {
                probe.stage(self.state.block, name, values);
            }
            probe.stage(self.state.block, "poses", maker.state.standardised());
        }
    }

    /// Takes the latent that the generator made.
    pub(super) fn take_latent(&mut self, tools: &SarahTools<'_>) {
        if let Some(maker) = self.state.maker.latent() {
            maker.take_latent(tools.model, self.options.guard, self.state.block, &mut self.probe);
        }
    }

    /// The decoder's part of the block, if there is one.
    pub(super) fn decoding(&mut self) -> Option<Decoding<'_>> {
        self.state.maker.latent().map(|maker| maker.decoding())
    }

    /// What follows the decoder: re-anchoring and catching up.
    pub(super) fn decoded(&mut self, tools: &mut SarahTools<'_>) {
        let BlockState { maker, motion, block, .. } = &mut *self.state;
        if let Some(maker) = maker.latent() {
            maker.decoded(tools, (self.options.guard, &self.plan), motion.root(), *block, &mut self.probe);
        }
    }

    /// What is left of it for a thread of its own.
    pub(super) fn posing(&mut self) -> Posing<'_> {
        Posing { state: self.state, plan: &self.plan, outcome: &mut self.outcome }
    }

    /// Tells about the frames; the block is done.
    pub(super) fn end(&mut self) {
        if self.outcome.is_err() {
            return;
        }
        if let Some(probe) = &mut self.probe {
            probe.frames(self.state.block, &self.state.frames);
            if let Some(maker) = self.state.maker.step() {
                tell(&mut self.probe, self.state.block, "dyadic", maker.state.shares());
            }
        }
        self.state.block += 1;
    }
}

impl Posing<'_> {
    /// Makes the frames, on the threads of `pool` if there is one.
    pub(super) fn run(&mut self, pool: Option<&mut Pool>, engine: &Engine) {
        *self.outcome = self.state.pose(pool, engine);
        if self.outcome.is_ok() {
            self.state.label(engine, self.plan);
        }
    }
}

impl BlockState {
    /// Lets the fallback make the block.
    fn fall_back(&mut self, options: &SessionOptions) -> Result<()> {
        let Self { fallback, inputs, motion, frames, block, .. } = self;
        let Some(fallback) = fallback else { return Ok(()) };
        fallback.make((*block, options.diagnostics.first_block, options.gaze), inputs, motion, frames)
    }

    /// Makes frames of what was made.
    fn pose(&mut self, pool: Option<&mut Pool>, engine: &Engine) -> Result<()> {
        let Self { maker, motion, frames, .. } = self;
        match (maker, &engine.model) {
            (Maker::Latent(maker), Model::Sarah(sarah)) => maker.pose(sarah, motion, pool, frames),
            (Maker::Step(maker), Model::Dram(dram)) => maker.pose(dram, motion, pool, frames),
            _ => Ok(()),
        }
    }

    /// Says of the frames when they are shown, what made them and where they look.
    fn label(&mut self, engine: &Engine, plan: &Plan) {
        for (i, frame) in self.frames.iter_mut().enumerate() {
            frame.index = self.block * BLOCK_FRAMES as u64 + i as u64;
            frame.time = frame.index as f64 / f64::from(FPS);
            frame.sampler = plan.sampler;
            let head = &frame.global[self.head];
            frame.gaze = self.inputs.head_at(frame.index).and_then(|user| gaze_score(&engine.config.rig, head, user));
        }
    }
}
