//! All of a session that changes from block to block.

use super::SessionOptions;
use super::anchor::Anchor;
use super::governor::{Outlook, Work};
use super::inputs::Inputs;
use super::noise::Noise;
use super::tools::Tools;
use crate::engine::Engine;
use crate::error::Result;
use crate::flow::{Condition, Generator, GeneratorOptions};
use crate::frame::{BLOCK_FRAMES, Frame, Sampler};
use crate::kernels::Exec;
use crate::normaliser::{Metric, Standardised};
use crate::pose;
use crate::vae::{DecoderState, Decoding};

/// All that changes from block to block.
pub(super) struct BlockState {
    pub(super) inputs: Inputs,
    pub(super) generator: Generator,
    pub(super) decoder: DecoderState,
    pub(super) anchor: Anchor,
    pub(super) motion: pose::Decoder,
    pub(super) work: Work,
    /// The rig's head.
    pub(super) head: usize,
    pub(super) noise: Noise,
    /// The block's latent, in both scales.
    pub(super) z: Standardised,
    pub(super) latent: Metric,
    /// The block's features, `[4, features]`, in both scales.
    pub(super) features: Standardised,
    pub(super) metric: Metric,
    /// Whether they mean anything.
    pub(super) made: Made,
    pub(super) frames: Vec<Frame>,
    /// The next block.
    pub(super) block: u64,
}

/// What the generator made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Made {
    /// A latent.
    Latent,
    /// Numbers that are no latent: the guard answers for the block.
    Unusable,
}

impl BlockState {
    /// All memory; [`BlockState::reset`] makes it a start.
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
        let features = BLOCK_FRAMES * engine.features();
        Ok(Self {
            inputs: Inputs::new(engine, options)?,
            generator,
            decoder: engine.decoder.state(options.diagnostics.cache),
            anchor: Anchor::new(engine, options),
            motion,
            work: Work::new(&engine.config),
            head: rig.index("head").unwrap_or(0),
            noise: Noise::Seeded,
            z: Standardised::zeros(engine.config.vae.latent),
            latent: Metric::zeros(engine.config.vae.latent),
            features: Standardised::zeros(features),
            metric: Metric::zeros(features),
            made: Made::Latent,
            frames: (0..BLOCK_FRAMES).map(|_| Frame::empty(rig.joints.len())).collect(),
            block: 0,
        })
    }

    /// Back to the start: `idle`, latents of the idle clip, as history, the agent where the options
    /// put it.
    pub(super) fn reset(&mut self, tools: &mut Tools<'_>, options: &SessionOptions, idle: Standardised<&[f32]>) {
        let engine = tools.engine;
        self.block = options.diagnostics.first_block;
        self.inputs.reset(self.block);
        self.generator.reset(self.block);
        self.decoder.reset(self.block);
        self.anchor.reset(options.start, self.block);
        self.motion.reset(options.start);
        tools.exec.begin();
        let blocks = idle.values().len() / engine.latent.width();
        for i in 0..blocks {
            let z = idle.part(i..i + 1, engine.latent.width());
            let Self { generator, noise, inputs, .. } = self;
            generator.append(&inputs.condition, z, |token, eps| noise.fill(engine, options, token, eps));
            engine.latent.restore(z, self.latent.view_mut());
            tools.decode(self.decoding());
            self.anchor.remember(Some(self.features.view()));
        }
        self.generator.warm_up(&mut tools.flow());
        tools.exec.end();
        if blocks > 0 {
            engine.pose.restore(self.features.view(), self.metric.view_mut());
            self.motion.prime(self.metric.part(BLOCK_FRAMES - 1..BLOCK_FRAMES, engine.features()));
        }
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

    /// The decoder's part of the block: features of the latent.
    pub(super) fn decoding(&mut self) -> Decoding<'_> {
        Decoding { state: &mut self.decoder, z: self.latent.view(), out: self.features.view_mut() }
    }
}
