//! The computation of a block.

use super::SessionOptions;
use super::anchor::Anchor;
use super::governor::{Hold, Outlook, Plan, Work};
use super::inputs::{Inputs, Listening, listen};
use super::probe::{Probe, tell};
use crate::engine::Engine;
use crate::error::Result;
use crate::flow::{Condition, Generator, GeneratorOptions, SharedPass, normal};
use crate::frame::{BLOCK_FRAMES, FPS, Frame, Sampler};
use crate::kernels::Exec;
use crate::par::Pool;
use crate::pose::{self, gaze_score};
use crate::vae::{DecoderState, Decoding};

/// Standardised latents are of unit scale; what is this far out, or not a number, is no latent.
const MAX_LATENT: f32 = 1000.0;

/// Where the noise of tokens comes from.
#[derive(Debug)]
pub(super) enum Noise {
    /// From the session's seed.
    Seeded,
    /// Given values, `[tokens, latent]`; seeded beyond their end.
    Given(Vec<f32>),
}

/// All that changes from block to block.
pub(super) struct BlockState {
    pub(super) inputs: Inputs,
    pub(super) generator: Generator,
    decoder: DecoderState,
    pub(super) anchor: Anchor,
    pub(super) motion: pose::Decoder,
    pub(super) work: Work,
    head: usize,
    pub(super) noise: Noise,
    /// The latent, unstandardised.
    latent: Vec<f32>,
    /// Whether it was one.
    usable: bool,
    /// Four frames of features; standardised, then not.
    features: Vec<f32>,
    pub(super) frames: Vec<Frame>,
    /// The next block.
    pub(super) block: u64,
}

impl BlockState {
    pub(super) fn new(exec: &mut Exec, engine: &Engine, options: &SessionOptions) -> Result<Self> {
        let generator_options = GeneratorOptions {
            sampler: options.sampler,
            dtype: options.diagnostics.cache,
            clean_history: options.clean_history(engine),
        };
        let condition = Condition::absent(engine.layout());
        exec.begin();
        let generator = Generator::new(exec, engine.nets(), &condition, generator_options);
        exec.end();
        let mut generator = generator?;
        if options.diagnostics.gaze_control.guides(options.gaze) {
            generator.open_gaze();
        }
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
        let mut state = Self {
            inputs: Inputs::new(engine, options)?,
            generator,
            decoder: engine.decoder.state(options.diagnostics.cache),
            anchor: Anchor::new(engine, options),
            motion,
            work: Work::new(&engine.config),
            head: rig.index("head").unwrap_or(0),
            noise: Noise::Seeded,
            latent: vec![0.0; engine.config.vae.latent],
            usable: true,
            features: vec![0.0; BLOCK_FRAMES * engine.features()],
            frames: (0..BLOCK_FRAMES).map(|_| Frame::empty(rig.joints.len())).collect(),
            block: 0,
        };
        state.reset(exec, engine, options)?;
        Ok(state)
    }

    /// Back to the start: the idle clip as history, the agent where the options put it.
    pub(super) fn reset(&mut self, exec: &mut Exec, engine: &Engine, options: &SessionOptions) -> Result<()> {
        self.block = options.diagnostics.first_block;
        self.inputs.reset(self.block);
        self.generator.reset(self.block);
        self.decoder.reset(self.block);
        self.anchor.reset(options.start, self.block);
        self.motion.reset(options.start);
        let temperature = options.temperature(engine);
        let absent = &self.inputs.condition;
        exec.begin();
        for z in engine.idle.chunks_exact(engine.config.vae.latent) {
            let noise = &self.noise;
            self.generator.append(absent, z, |token, eps| noise.fill(options, temperature, token, eps));
            self.latent.copy_from_slice(z);
            engine.latent.restore(&mut self.latent);
            engine.decoder.step(exec, &mut self.decoder, &self.latent, &mut self.features);
            self.anchor.remember(&self.features);
        }
        self.generator.warm_up(exec, engine.nets());
        exec.end();
        if !engine.idle.is_empty() {
            engine.pose.restore(&mut self.features);
            let width = engine.features();
            self.motion.prime(&self.features[(BLOCK_FRAMES - 1) * width..]);
        }
        Ok(())
    }

    pub(super) fn supports(&self, sampler: Sampler) -> bool {
        self.generator.supports(sampler)
    }

    pub(super) fn cache_bytes(&self) -> usize {
        self.generator.cache_bytes() + self.decoder.cache_bytes() + self.anchor.cache_bytes()
    }

    /// What the next block would cost on each of `ladder`, best first.
    pub(super) fn outlook(&self, ladder: &[Sampler], branches: usize) -> Outlook {
        let mut outlook = Outlook {
            pass: self.work.pass(branches),
            anchor: self.work.anchor(self.anchor.share(), branches),
            ..Outlook::default()
        };
        for (i, sampler) in ladder.iter().enumerate() {
            outlook.rungs[i] = self.work.block(&self.generator, *sampler, branches);
            let behind = self.generator.visits(*sampler).map(|slot| self.generator.behind(slot));
            outlook.behind[i] = behind.max().unwrap_or(0);
        }
        outlook
    }

    /// Computes the next block into `frames`, or holds the last pose. Allocates nothing, takes no lock, makes no system call
    /// (`tests/sanitize.sh realtime` has the sanitizer watch this function).
    #[cfg_attr(visavis_rtsan, sanitize(realtime = "nonblocking"))]
    pub(super) fn compute(
        &mut self,
        exec: &mut Exec,
        engine: &Engine,
        options: &SessionOptions,
        plan: &Plan,
        mut probe: Option<&mut dyn Probe>,
    ) -> Result<()> {
        if plan.hold == Hold::No {
            listen(exec, engine, &mut self.ears());
            self.prepare(engine, options, plan, &mut probe)?;
            self.sample(exec, engine, options, plan, &mut probe);
            self.decode(exec, engine, options, plan, &mut probe);
            self.pose(Some(exec.pool_mut()), engine)?;
        } else {
            self.hold(exec, engine, plan)?;
        }
        self.present(engine, plan, &mut probe);
        Ok(())
    }

    /// Labels the frames; the block is done.
    pub(super) fn present(&mut self, engine: &Engine, plan: &Plan, probe: &mut Option<&mut dyn Probe>) {
        for (i, frame) in self.frames.iter_mut().enumerate() {
            frame.index = self.block * BLOCK_FRAMES as u64 + i as u64;
            frame.time = frame.index as f64 / f64::from(FPS);
            frame.sampler = plan.sampler;
            let head = &frame.global[self.head];
            frame.gaze = self.inputs.head_at(frame.index).and_then(|user| gaze_score(&engine.config.rig, head, user));
        }
        tell_frames(probe, self.block, &self.frames);
        self.block += 1;
    }

    fn hold(&mut self, exec: &mut Exec, engine: &Engine, plan: &Plan) -> Result<()> {
        self.inputs.skip(self.block)?;
        if plan.hold == Hold::Rehearse {
            self.inputs.condition.clear();
            self.generator.rehearse(exec, engine.nets(), plan.sampler, &self.inputs.condition);
        }
        self.motion.hold_block(&mut self.frames);
        Ok(())
    }

    /// The voices, to listen for the next block.
    pub(super) fn ears(&mut self) -> [Listening<'_>; 2] {
        self.inputs.ears(self.block)
    }

    /// Makes the conditioning of the next block, for which voices have listened.
    pub(super) fn prepare(
        &mut self,
        engine: &Engine,
        options: &SessionOptions,
        plan: &Plan,
        probe: &mut Option<&mut dyn Probe>,
    ) -> Result<()> {
        let config = engine.config.gaze.as_ref();
        let gaze = options.diagnostics.gaze_control.cue(config, options.gaze, plan.sampler, options.seed, self.block);
        self.inputs.prepare(self.block, &self.motion.root(), gaze, probe)
    }

    /// Makes the latent.
    fn sample(
        &mut self,
        exec: &mut Exec,
        engine: &Engine,
        options: &SessionOptions,
        plan: &Plan,
        probe: &mut Option<&mut dyn Probe>,
    ) {
        let (block, noise, temperature) = (self.block, &self.noise, options.temperature(engine));
        let mut tap = probe.as_mut().map(|p| |_: usize, x1: &[f32]| p.stage(block, "x1", x1));
        self.generator.sample(
            exec,
            engine.nets(),
            plan.sampler,
            options.guidance(engine),
            &self.inputs.condition,
            |token, eps| noise.fill(options, temperature, token, eps),
            tap.as_mut().map(|tap| tap as _),
        );
    }

    /// Begins the latent, for [`SharedPass::sample`] to make.
    pub(super) fn begin_shared(&mut self, engine: &Engine, options: &SessionOptions, plan: &Plan) {
        let (noise, temperature) = (&self.noise, options.temperature(engine));
        let (guidance, condition) = (options.guidance(engine), &self.inputs.condition);
        SharedPass::begin(&mut self.generator, plan.sampler, guidance, condition, |token, eps| {
            noise.fill(options, temperature, token, eps);
        });
    }

    /// Makes features of the latent that the generator made last.
    fn decode(
        &mut self,
        exec: &mut Exec,
        engine: &Engine,
        options: &SessionOptions,
        plan: &Plan,
        probe: &mut Option<&mut dyn Probe>,
    ) {
        self.take_latent(engine, options, probe);
        engine.decoder.step(exec, &mut self.decoder, &self.latent, &mut self.features);
        self.decoded(exec, engine, options, plan, probe);
    }

    /// Takes the latent that the generator made last, for [`BlockState::decoding`].
    pub(super) fn take_latent(
        &mut self,
        engine: &Engine,
        options: &SessionOptions,
        probe: &mut Option<&mut dyn Probe>,
    ) {
        let token = self.generator.history().len() - 1;
        self.latent.copy_from_slice(self.generator.history().z(token));
        tell(probe, self.block, "latents", &self.latent);

        self.usable = !options.guard || self.latent.iter().all(|z| z.abs() < MAX_LATENT);
        if !self.usable {
            // Nothing of the kind may stay in the history or in a cache.
            self.latent.fill(0.0);
            self.generator.history_mut().replace(token, &self.latent);
            self.generator.forget();
        }
        engine.latent.restore(&mut self.latent);
    }

    /// The decoder's part of the block: features of the latent.
    pub(super) fn decoding(&mut self) -> Decoding<'_> {
        Decoding { state: &mut self.decoder, z: &self.latent, out: &mut self.features }
    }

    /// What follows the decoder: re-anchoring and catching up.
    pub(super) fn decoded(
        &mut self,
        exec: &mut Exec,
        engine: &Engine,
        options: &SessionOptions,
        plan: &Plan,
        probe: &mut Option<&mut dyn Probe>,
    ) {
        let (block, root) = (self.block, self.motion.root());
        if options.guard && !finite(&self.features) {
            self.decoder.reset(block);
        }
        if !self.usable {
            // The guard holds a pose for it.
            self.features.fill(f32::NAN);
        }
        self.anchor.step(
            exec,
            engine,
            &mut self.generator,
            &mut self.decoder,
            &self.latent,
            &mut self.features,
            &root,
            plan.anchor,
        );
        tell(probe, block, "decoded", &self.features);
        if let Some((passes, sampler)) = plan.catch_up {
            for _ in 0..passes {
                self.generator.catch_up(exec, engine.nets(), sampler);
            }
        }
    }

    /// Makes frames of the features, on the threads of `pool` if there is one.
    pub(super) fn pose(&mut self, pool: Option<&mut Pool>, engine: &Engine) -> Result<()> {
        engine.pose.restore(&mut self.features);
        let before = self.motion.guard_stats();
        self.motion.decode_block_on(pool, &self.features, &mut self.frames)?;
        if self.frames.iter().any(|frame| frame.held > 0.0) {
            // The history must hold what was shown.
            self.motion.shown(&mut self.features);
            engine.pose.standardise_all(&mut self.features);
            self.anchor.amend(&self.features);
        }
        if self.motion.guard_stats().trips > before.trips {
            self.anchor.request();
        }
        Ok(())
    }
}

fn finite(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite())
}

impl Noise {
    /// Seeded noise is scaled by `temperature`; given noise enters as it is.
    fn fill(&self, options: &SessionOptions, temperature: f32, token: u64, eps: &mut [f32]) {
        if let Noise::Given(values) = self
            && let Some(given) = values.chunks_exact(eps.len()).nth((token - options.diagnostics.first_block) as usize)
        {
            return eps.copy_from_slice(given);
        }
        normal(options.seed, token, eps);
        eps.iter_mut().for_each(|e| *e *= temperature);
    }
}

/// Frames as flat arrays; allocates, and only when somebody listens.
fn tell_frames(probe: &mut Option<&mut dyn Probe>, block: u64, frames: &[Frame]) {
    if probe.is_none() {
        return;
    }
    let roots: Vec<f32> = frames.iter().flat_map(|f| [f.root.x as f32, f.root.z as f32, f.root.yaw as f32]).collect();
    let joints = || frames.iter().flat_map(|f| &f.global);
    let positions: Vec<f32> = joints().flat_map(|t| t.position.to_array()).collect();
    let rotations: Vec<f32> = joints().flat_map(|t| t.rotation.to_array()).collect();
    tell(probe, block, "roots", &roots);
    tell(probe, block, "positions", &positions);
    tell(probe, block, "rotations", &rotations);
}
