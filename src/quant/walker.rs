//! The stages of an engine, driven by hand, so that each block's past can be chosen.

use super::scene::Scene;
use super::teacher::Step;
use crate::audio::AudioEncoder;
use crate::engine::Engine;
use crate::error::Result;
use crate::flow::{Condition, Generator, GeneratorOptions, Guidance, normal};
use crate::frame::{BLOCK_FRAMES, Frame, Sampler};
use crate::kernels::{Activations, Exec, KvDtype};
use crate::pose::{self, gaze_score};
use crate::vae::DecoderState;

/// The stages of an engine, driven by hand.
pub(super) struct Walker<'e> {
    engine: &'e Engine,
    pub(super) exec: Exec,
    generator: Generator,
    sampler: Sampler,
    seed: u64,
    decoder: DecoderState,
    pub(super) motion: pose::Decoder,
    ears: [AudioEncoder; 2],
    heard: Vec<f32>,
    condition: Condition,
    scratch: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) features: Vec<f32>,
    pub(super) frames: Vec<Frame>,
}

impl<'e> Walker<'e> {
    /// At the start, with the idle clip's latents `idle` behind it.
    pub(super) fn new(
        engine: &'e Engine,
        sampler: Sampler,
        seed: u64,
        idle: &[f32],
        activations: Option<Activations>,
    ) -> Result<Self> {
        let c = engine.config();
        let mut exec = engine.exec(1)?;
        exec.listen(activations);
        let condition = Condition::absent(engine.layout());
        let options = GeneratorOptions { sampler, dtype: KvDtype::F16, clean_history: c.session.clean_history };
        let generator = Generator::new(&mut exec, engine.nets(), &condition, options)?;
        let mut this = Self {
            generator,
            sampler,
            seed,
            decoder: engine.decoder.state(KvDtype::F16),
            motion: pose::Decoder::new(engine.kernels, &c.rig, c.pose.radius).with_stance(&c.rig),
            ears: [AudioEncoder::new(&c.audio)?, AudioEncoder::new(&c.audio)?],
            heard: vec![0.0; BLOCK_FRAMES * c.audio.features],
            condition,
            scratch: vec![0.0; c.vae.latent],
            z: vec![0.0; c.vae.latent],
            features: vec![0.0; BLOCK_FRAMES * engine.features()],
            frames: vec![Frame::empty(c.rig.len()); BLOCK_FRAMES],
            engine,
            exec,
        };
        this.exec.begin();
        for z in idle.chunks_exact(c.vae.latent) {
            let temperature = c.session.temperature;
            this.generator.append(&this.condition, z, |token, eps| noise(seed, temperature, token, eps));
            this.decode(z);
        }
        this.generator.warm_up(&mut this.exec, engine.nets());
        this.exec.end();
        Ok(this)
    }

    /// Computes block `block` from what is behind it.
    pub(super) fn block(&mut self, scene: &Scene, block: usize) -> Result<()> {
        let (engine, c) = (self.engine, self.engine.config());
        self.exec.begin();
        self.condition.clear();
        let voices = [(&scene.agent, c.agent_delay_blocks), (&scene.user, c.user_delay_blocks)];
        for (i, (voice, delay)) in voices.into_iter().enumerate() {
            let Some(samples) = Scene::samples(voice, block, delay) else { continue };
            self.ears[i].encode(&mut self.exec, &engine.audio, samples, &mut self.heard);
            match i {
                0 => self.condition.set_agent_voice(&self.heard),
                _ => self.condition.set_user_voice(&self.heard),
            }
        }
        if let Some(positions) = scene.positions(block, c.user_delay_blocks, &self.motion.root()) {
            self.condition.set_user(&positions);
        }
        if let Some(target) = scene.gaze {
            self.condition.set_gaze(target, true);
        }
        let (seed, temperature) = (self.seed, c.session.temperature);
        let guidance = Guidance { weight: c.session.guidance, gaze: c.session.gaze_guidance };
        let (exec, nets) = (&mut self.exec, engine.nets());
        let noise = |token, eps: &mut [f32]| noise(seed, temperature, token, eps);
        let z = self.generator.sample(exec, nets, self.sampler, guidance, &self.condition, noise, None);
        self.z.copy_from_slice(z);
        let z = std::mem::take(&mut self.z);
        self.decode(&z);
        self.z = z;
        self.exec.end();
        let mut unstandardised = self.features.clone();
        engine.pose.restore(&mut unstandardised);
        let head = c.rig.index("head");
        let xs = unstandardised.chunks_exact(engine.features());
        for (i, (frame, x)) in self.frames.iter_mut().zip(xs).enumerate() {
            self.motion.decode(x, frame)?;
            frame.gaze = head
                .zip(scene.heads[block * BLOCK_FRAMES + i])
                .and_then(|(head, user)| gaze_score(&c.rig, &frame.global[head], user));
        }
        Ok(())
    }

    /// Decodes a standardised latent into `self.features`.
    fn decode(&mut self, z: &[f32]) {
        self.scratch.copy_from_slice(z);
        self.engine.latent.restore(&mut self.scratch);
        self.engine.decoder.step(&mut self.exec, &mut self.decoder, &self.scratch, &mut self.features);
    }

    /// Puts the teacher's block in the place of the one just made.
    pub(super) fn follow(&mut self, step: &Step) {
        let token = self.generator.history().len() - 1;
        self.generator.history_mut().replace(token, &step.z);
        self.decoder.back();
        self.exec.begin();
        self.decode(&step.z);
        self.exec.end();
        self.motion.clone_from(&step.after);
    }
}

/// Seeded noise as in a session.
fn noise(seed: u64, temperature: f32, token: u64, eps: &mut [f32]) {
    normal(seed, token, eps);
    eps.iter_mut().for_each(|e| *e *= temperature);
}
