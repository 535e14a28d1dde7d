//! One session's block, stage by stage. What computes it is the [`pipeline`](super::pipeline).

use super::SessionOptions;
use super::anchor::Moment;
use super::governor::{Hold, Plan};
use super::inputs::Listening;
use super::probe::Probe;
use super::state::{BlockState, Made};
use super::tools::Tools;
use crate::engine::Engine;
use crate::error::Result;
use crate::flow::Generator;
use crate::frame::{BLOCK_FRAMES, FPS};
use crate::par::Pool;
use crate::pose::gaze_score;
use crate::vae::Decoding;

/// Standardised latents are of unit scale; what is this far out, or not a number, is no latent.
const MAX_LATENT: f32 = 1000.0;

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

    /// The voices, to listen for it.
    pub(super) fn voices(&mut self) -> [Listening<'_>; 2] {
        self.state.inputs.voice_inputs(self.state.block)
    }

    pub(super) fn generator(&mut self) -> &mut Generator {
        &mut self.state.generator
    }

    /// Holds the last pose instead of computing motion, and rehearses a step where the plan says
    /// so.
    pub(super) fn hold(&mut self, tools: &mut Tools<'_>) {
        let Self { plan, state, .. } = self;
        self.outcome = state.inputs.skip(state.block);
        if self.outcome.is_err() {
            return;
        }
        if plan.hold == Hold::Rehearse {
            state.inputs.condition.clear();
            state.generator.rehearse(&mut tools.flow(), plan.sampler, &state.inputs.condition);
        }
        state.motion.hold_block(&mut state.frames);
        state.label(tools.engine, plan);
    }

    /// Makes the conditioning, for which voices have listened, and begins the latent.
    pub(super) fn begin(&mut self, engine: &Engine) {
        let Self { options, plan, state, probe, .. } = self;
        let gaze = engine.config.gaze.as_ref();
        let gaze = options.diagnostics.gaze_control.cue(gaze, options.gaze, plan.sampler, options.seed, state.block);
        self.outcome = state.inputs.prepare(state.block, &state.motion.root(), gaze, probe);
        if self.outcome.is_err() {
            return;
        }
        let BlockState { generator, inputs, noise, .. } = &mut **state;
        generator.begin(plan.sampler, options.guidance(engine), &inputs.condition, |token, eps| {
            noise.fill(engine, options, token, eps);
        });
    }

    /// Tells about an evaluation of the network.
    pub(super) fn evaluated(&mut self) {
        if let Some(probe) = &mut self.probe {
            probe.stage(self.state.block, "x1", self.state.generator.x1());
        }
    }

    /// Takes the latent that the generator made.
    pub(super) fn take_latent(&mut self, engine: &Engine) {
        let state = &mut *self.state;
        state.z.values_mut().copy_from_slice(state.generator.last_latent().values());
        if let Some(probe) = &mut self.probe {
            probe.stage(state.block, "latents", state.z.values());
        }
        let usable = !self.options.guard || state.z.values().iter().all(|z| z.abs() < MAX_LATENT);
        state.made = if usable { Made::Latent } else { Made::Unusable };
        if !usable {
            // Nothing of the kind may stay in the history or in a cache.
            state.z.values_mut().fill(0.0);
            state.generator.replace(state.generator.next_token() - 1, state.z.view());
            state.generator.forget();
        }
        engine.latent.restore(state.z.view(), state.latent.view_mut());
    }

    /// The decoder's part of the block.
    pub(super) fn decoding(&mut self) -> Decoding<'_> {
        self.state.decoding()
    }

    /// What follows the decoder: re-anchoring and catching up.
    pub(super) fn decoded(&mut self, tools: &mut Tools<'_>) {
        let state = &mut *self.state;
        if self.options.guard && !state.features.values().iter().all(|v| v.is_finite()) {
            state.decoder.reset(state.block);
        }
        let usable = state.made == Made::Latent;
        let moment = Moment {
            generator: &mut state.generator,
            decoder: &mut state.decoder,
            latent: state.latent.view(),
            features: usable.then(|| state.features.view_mut()),
            root: state.motion.root(),
            time: self.plan.anchor,
        };
        state.anchor.step(tools, moment);
        if let (Some(probe), true) = (&mut self.probe, usable) {
            probe.stage(state.block, "decoded", state.features.values());
        }
        if let Some((passes, sampler)) = self.plan.catch_up {
            for _ in 0..passes {
                state.generator.catch_up(&mut tools.flow(), sampler);
            }
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
    /// Makes frames of the features.
    fn pose(&mut self, pool: Option<&mut Pool>, engine: &Engine) -> Result<()> {
        let before = self.motion.guard_stats();
        match self.made {
            Made::Latent => {
                engine.pose.restore(self.features.view(), self.metric.view_mut());
                self.motion.decode_block_on(pool, self.metric.view(), &mut self.frames)?;
            }
            Made::Unusable => self.motion.miss_block_on(pool, &mut self.frames),
        }
        if self.frames.iter().any(|frame| frame.held > 0.0) {
            // The history must hold what was shown.
            self.motion.shown(self.metric.view_mut());
            engine.pose.standardise(self.metric.view(), self.features.view_mut());
            self.anchor.amend(self.features.view());
        }
        if self.motion.guard_stats().trips > before.trips {
            self.anchor.request();
        }
        Ok(())
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
