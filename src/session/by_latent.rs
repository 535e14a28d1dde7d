//! Poses of the flow model: a latent a block, decoded; the history encoded anew now and then.

use super::SessionOptions;
use super::anchor::{Anchor, Moment};
use super::governor::{Outlook, Plan, Work};
use super::inputs::Inputs;
use super::noise::Noise;
use super::probe::{Probe, tell};
use super::tools::SarahTools;
use crate::engine::{Engine, Sarah};
use crate::error::Result;
use crate::flow::{Condition, Generator, GeneratorOptions};
use crate::frame::{BLOCK_FRAMES, Frame, Root, Sampler};
use crate::kernels::Exec;
use crate::normaliser::{Metric, Standardised};
use crate::par::Pool;
use crate::pose;
use crate::vae::{DecoderState, Decoding};

/// Standardised latents are of unit scale; what is this far out, or not a number, is no latent.
const MAX_LATENT: f32 = 1000.0;

/// What the flow model remembers of one session.
pub(super) struct ByLatent {
    pub(super) generator: Generator,
    pub(super) decoder: DecoderState,
    pub(super) anchor: Anchor,
    pub(super) work: Work,
    pub(super) noise: Noise,
    /// The block's latent, in both scales.
    pub(super) z: Standardised,
    pub(super) latent: Metric,
    /// The block's features, `[4, features]`, in both scales.
    pub(super) features: Standardised,
    metric: Metric,
    /// Whether they mean anything.
    made: Made,
}

/// What the generator made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Made {
    /// A latent.
    Latent,
    /// Numbers that are no latent: the guard answers for the block.
    Unusable,
}

impl ByLatent {
    pub(super) fn new(exec: &mut Exec, engine: &Engine, sarah: &Sarah, options: &SessionOptions) -> Result<Self> {
        let generator_options = GeneratorOptions {
            sampler: options.sampler,
            dtype: options.diagnostics.cache,
            clean_history: options.clean_history(engine),
            guided_until: engine.config.session.guided_until,
        };
        let condition = Condition::absent(engine.layout());
        exec.begin();
        let generator = Generator::new(exec, sarah.nets(), &condition, generator_options);
        exec.end();
        let mut generator = generator?;
        if options.diagnostics.gaze_control.guides(options.gaze) {
            generator.open_gaze();
        }
        let features = BLOCK_FRAMES * sarah.features();
        Ok(Self {
            generator,
            decoder: sarah.decoder.state(options.diagnostics.cache),
            anchor: Anchor::new(&engine.config, sarah, options),
            work: Work::new(&engine.config),
            noise: Noise::Seeded,
            z: Standardised::zeros(engine.config.vae.latent),
            latent: Metric::zeros(engine.config.vae.latent),
            features: Standardised::zeros(features),
            metric: Metric::zeros(features),
            made: Made::Latent,
        })
    }

    /// Back to the start: `idle`, latents of the idle clip, as history.
    pub(super) fn reset(
        &mut self,
        tools: &mut SarahTools<'_>,
        options: &SessionOptions,
        idle: Standardised<&[f32]>,
        first: u64,
        condition: &Condition,
        motion: &mut pose::Decoder,
    ) {
        let model = tools.model;
        self.generator.reset(first);
        self.decoder.reset(first);
        self.anchor.reset(options.start, first);
        tools.exec.begin();
        let temperature = options.temperature(tools.config, options.sampler);
        let blocks = idle.values().len() / model.latent.width();
        for i in 0..blocks {
            let z = idle.part(i..i + 1, model.latent.width());
            let Self { generator, noise, .. } = self;
            generator.append(condition, z, |token, eps| noise.fill(options, temperature, token, eps));
            model.latent.restore(z, self.latent.view_mut());
            tools.decode(self.decoding());
            self.anchor.remember(Some(self.features.view()));
        }
        self.generator.warm_up(&mut tools.flow());
        tools.exec.end();
        if blocks > 0 {
            model.pose.restore(self.features.view(), self.metric.view_mut());
            motion.prime(self.metric.part(BLOCK_FRAMES - 1..BLOCK_FRAMES, model.features()));
        }
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

    /// Evaluates the network once for nothing: what it takes is known then.
    pub(super) fn rehearse(&mut self, tools: &mut SarahTools<'_>, inputs: &mut Inputs, sampler: Sampler) {
        inputs.condition.clear();
        self.generator.rehearse(&mut tools.flow(), sampler, &inputs.condition);
    }

    /// Takes the latent that the generator made.
    pub(super) fn take_latent(&mut self, sarah: &Sarah, guard: bool, block: u64, probe: &mut Option<&mut dyn Probe>) {
        self.z.values_mut().copy_from_slice(self.generator.last_latent().values());
        tell(probe, block, "latents", self.z.values());
        let usable = !guard || self.z.values().iter().all(|z| z.abs() < MAX_LATENT);
        self.made = if usable { Made::Latent } else { Made::Unusable };
        if !usable {
            // Nothing of the kind may stay in the history or in a cache.
            self.z.values_mut().fill(0.0);
            self.generator.replace(self.generator.next_token() - 1, self.z.view());
            self.generator.forget();
        }
        sarah.latent.restore(self.z.view(), self.latent.view_mut());
    }

    /// What follows the decoder: re-anchoring and catching up.
    pub(super) fn decoded(
        &mut self,
        tools: &mut SarahTools<'_>,
        (guard, plan): (bool, &Plan),
        root: Root,
        block: u64,
        probe: &mut Option<&mut dyn Probe>,
    ) {
        if guard && !self.features.values().iter().all(|v| v.is_finite()) {
            self.decoder.reset(block);
        }
        let usable = self.made == Made::Latent;
        let moment = Moment {
            generator: &mut self.generator,
            decoder: &mut self.decoder,
            latent: self.latent.view(),
            features: usable.then(|| self.features.view_mut()),
            root,
            time: plan.anchor,
        };
        self.anchor.step(tools, moment);
        if usable {
            tell(probe, block, "decoded", self.features.values());
        }
        if let Some((passes, sampler)) = plan.catch_up {
            for _ in 0..passes {
                self.generator.catch_up(&mut tools.flow(), sampler);
            }
        }
    }

    /// Makes frames of the features.
    pub(super) fn pose(
        &mut self,
        sarah: &Sarah,
        motion: &mut pose::Decoder,
        pool: Option<&mut Pool>,
        frames: &mut [Frame],
    ) -> Result<()> {
        let before = motion.guard_stats();
        match self.made {
            Made::Latent => {
                sarah.pose.restore(self.features.view(), self.metric.view_mut());
                motion.decode_block_on(pool, self.metric.view(), frames)?;
            }
            Made::Unusable => motion.miss_block_on(pool, frames),
        }
        if frames.iter().any(|frame| frame.held > 0.0) {
            // The history must hold what was shown.
            motion.shown(self.metric.view_mut());
            sarah.pose.standardise(self.metric.view(), self.features.view_mut());
            self.anchor.amend(self.features.view());
        }
        if motion.guard_stats().trips > before.trips {
            self.anchor.request();
        }
        Ok(())
    }
}
