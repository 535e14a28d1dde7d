//! Teacher-forced comparison: what another engine makes of each block, given the history that a reference engine made.
//!
//! The reference runs freely over a scene. The candidate then computes every block from the reference's past: the same latents
//! behind it (through its own weights), the same root and posture, the same noise, the same user. So the difference is that of one
//! block, and does not grow. Its voices go through its own audio encoder. Neither re-anchors.

use super::argument;
use crate::audio::AudioEncoder;
use crate::engine::Engine;
use crate::error::Result;
use crate::flow::{Condition, Generator, GeneratorOptions, Guidance, normal};
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FPS, Frame, Root, Sampler};
use crate::kernels::{Activations, Exec, KvDtype};
use crate::offline::Conversation;
use crate::pose::{self, gaze_score};
use crate::vae::DecoderState;
use glam::Vec3;

/// A conversation cut into blocks.
#[derive(Debug, Clone)]
pub struct Scene {
    agent: Vec<f32>,
    user: Vec<f32>,
    /// The user's head at each frame.
    heads: Vec<Option<Vec3>>,
    blocks: usize,
    gaze: Option<f32>,
}

impl Scene {
    /// The first `blocks` blocks of `talk` (all of it when it is shorter), with a gaze target or none.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) when there is not a whole block.
    pub fn new(talk: &Conversation, blocks: usize, gaze: Option<f32>) -> Result<Self> {
        let blocks = blocks.min(talk.frames() / BLOCK_FRAMES);
        if blocks == 0 {
            return Err(argument("the conversation is shorter than a block of four frames".to_owned()));
        }
        let voice = |v: Option<&[f32]>| {
            let mut v = v.unwrap_or_default().to_vec();
            v.resize(blocks * BLOCK_SAMPLES, 0.0);
            v
        };
        let head = |i: usize| talk.path().and_then(|p| p.at(i as f64 / f64::from(FPS)));
        let heads = (0..blocks * BLOCK_FRAMES).map(head).collect();
        Ok(Self { agent: voice(talk.agent()), user: voice(talk.user()), heads, blocks, gaze })
    }

    /// The same user and length with the two voices exchanged: a conversation that nothing was chosen by.
    #[must_use]
    pub fn exchanged(&self) -> Self {
        Self { agent: self.user.clone(), user: self.agent.clone(), ..self.clone() }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    fn samples(voice: &[f32], block: usize, delay: u32) -> Option<&[f32]> {
        let heard = block.checked_sub(delay as usize)?;
        Some(&voice[heard * BLOCK_SAMPLES..][..BLOCK_SAMPLES])
    }

    /// The user over the block that `block` may know, in the agent's frame.
    fn positions(&self, block: usize, delay: u32, root: &Root) -> Option<[f32; 2 * BLOCK_FRAMES]> {
        let seen = block.checked_sub(delay as usize)?;
        let mut positions = [0.0; 2 * BLOCK_FRAMES];
        for (i, xz) in positions.chunks_exact_mut(2).enumerate() {
            let local = root.to_local(self.heads[seen * BLOCK_FRAMES + i]?);
            xz.copy_from_slice(&[local.x, local.z]);
        }
        Some(positions)
    }
}

/// The stages of an engine, driven by hand.
struct Walker<'e> {
    engine: &'e Engine,
    exec: Exec,
    generator: Generator,
    sampler: Sampler,
    seed: u64,
    decoder: DecoderState,
    motion: pose::Decoder,
    ears: [AudioEncoder; 2],
    heard: Vec<f32>,
    condition: Condition,
    scratch: Vec<f32>,
    z: Vec<f32>,
    features: Vec<f32>,
    frames: Vec<Frame>,
}

impl<'e> Walker<'e> {
    /// At the start, with the idle clip's latents `idle` behind it.
    fn new(
        engine: &'e Engine,
        sampler: Sampler,
        seed: u64,
        idle: &[f32],
        activations: Option<Activations>,
    ) -> Result<Self> {
        let c = engine.config();
        let mut exec = engine.exec(1)?;
        exec.listen(activations);
        let student = engine.student.as_ref().zip(c.student.map(|s| s.tau_history));
        let condition = Condition::absent(engine.layout());
        let options = GeneratorOptions { sampler, dtype: KvDtype::F16, clean_history: c.session.clean_history };
        let generator = Generator::new(&mut exec, &engine.flow, student, &condition, options);
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
        this.generator.warm_up(&mut this.exec, &engine.flow, engine.student.as_ref());
        this.exec.end();
        Ok(this)
    }

    /// Computes block `block` from what is behind it.
    fn block(&mut self, scene: &Scene, block: usize) -> Result<()> {
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
            self.condition.set_gaze(target);
        }
        let (seed, temperature) = (self.seed, c.session.temperature);
        let guidance = Guidance { weight: c.session.guidance, gaze: c.session.gaze_guidance };
        let (exec, student) = (&mut self.exec, engine.student.as_ref());
        let noise = |token, eps: &mut [f32]| noise(seed, temperature, token, eps);
        let z =
            self.generator.sample(exec, &engine.flow, student, self.sampler, guidance, &self.condition, noise, None);
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
    fn follow(&mut self, step: &Step) {
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

/// A block of the reference.
struct Step {
    z: Vec<f32>,
    features: Vec<f32>,
    after: pose::Decoder,
    frames: Vec<Frame>,
}

/// A reference engine's run over a scene, which candidates are compared with.
pub struct Teacher<'e> {
    engine: &'e Engine,
    scene: Scene,
    sampler: Sampler,
    seed: u64,
    steps: Vec<Step>,
    /// The reference's features encoded and decoded again.
    round_trip: Vec<Vec<f32>>,
}

/// One frame of a candidate against the reference's.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameError {
    /// Distance of each joint, metres.
    pub joints: Vec<f32>,
    /// Angle between the rotations of each joint, radians.
    pub angles: Vec<f32>,
    /// Difference of the gaze scores, where both are known.
    pub gaze: Option<f32>,
}

/// A candidate's teacher-forced run.
#[derive(Debug, Clone)]
pub struct Forced {
    /// Every frame.
    pub frames: Vec<FrameError>,
    /// The reference's latents and the candidate's, standardised, block after block.
    pub latents: [Vec<f32>; 2],
    /// The reference's decoded features encoded and decoded again, joints against those of the reference's encoder and decoder: metres,
    /// joint after joint, frame after frame.
    pub round_trip: Vec<f32>,
}

impl Forced {
    /// Mean joint distance over all joints and frames, millimetres.
    pub fn mean_mm(&self) -> f64 {
        let all = self.frames.iter().flat_map(|f| &f.joints);
        1000.0 * mean(all)
    }

    /// Mean joint distance of the round trip through encoder and decoder, millimetres.
    pub fn round_trip_mm(&self) -> f64 {
        1000.0 * mean(&self.round_trip)
    }
}

fn mean<'a>(values: impl IntoIterator<Item = &'a f32>) -> f64 {
    let (sum, n) = values.into_iter().fold((0.0, 0usize), |(sum, n), &v| (sum + f64::from(v), n + 1));
    sum / n.max(1) as f64
}

impl<'e> Teacher<'e> {
    /// Runs `engine` over `scene`; `activations` listens to its layers.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) for the single step where the bundle has no student.
    pub fn new(
        engine: &'e Engine,
        scene: Scene,
        sampler: Sampler,
        seed: u64,
        activations: &mut Option<Activations>,
    ) -> Result<Self> {
        if sampler == Sampler::Single && engine.student.is_none() {
            return Err(argument("the single-step sampler needs a bundle with a student network".to_owned()));
        }
        let mut walker = Walker::new(engine, sampler, seed, &engine.idle, activations.take())?;
        let mut steps = Vec::with_capacity(scene.blocks);
        for block in 0..scene.blocks {
            walker.block(&scene, block)?;
            steps.push(Step {
                z: walker.z.clone(),
                features: walker.features.clone(),
                after: walker.motion.clone(),
                frames: walker.frames.clone(),
            });
        }
        *activations = walker.exec.listen(None);
        let mut this = Self { engine, scene, sampler, seed, steps, round_trip: Vec::new() };
        this.round_trip = this.through(engine, activations)?;
        Ok(this)
    }

    /// The sampler.
    pub fn sampler(&self) -> Sampler {
        self.sampler
    }

    /// The reference's frames, block after block.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.steps.iter().flat_map(|s| &s.frames)
    }

    /// What `candidate` makes of every block.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) when it has another rig or other sizes than the reference.
    pub fn compare(&self, candidate: &Engine) -> Result<Forced> {
        let (a, b) = (self.engine.config(), candidate.config());
        if (&a.rig, a.vae, a.flow, &a.audio) != (&b.rig, b.vae, b.flow, &b.audio) {
            return Err(argument("the candidate is not made from the reference: rig or sizes differ".to_owned()));
        }
        let mut walker = Walker::new(candidate, self.sampler, self.seed, &self.engine.idle, None)?;
        let mut forced = Forced { frames: Vec::new(), latents: [Vec::new(), Vec::new()], round_trip: Vec::new() };
        for (block, step) in self.steps.iter().enumerate() {
            walker.block(&self.scene, block)?;
            forced.latents[0].extend_from_slice(&step.z);
            forced.latents[1].extend_from_slice(&walker.z);
            forced.frames.extend(step.frames.iter().zip(&walker.frames).map(|(a, b)| FrameError::between(a, b)));
            walker.follow(step);
        }
        let radius = a.pose.radius;
        let joints = |x: &[f32]| -> Vec<Vec3> {
            let (_, joints) = x.split_at(crate::frame::ROOT_CHANNELS);
            let vertices = joints.as_chunks::<{ crate::frame::JOINT_CHANNELS }>().0;
            vertices.iter().map(|v| pose::icosahedron::decode(v, radius).0).collect()
        };
        for (a, b) in self.round_trip.iter().zip(self.through(candidate, &mut None)?) {
            for (a, b) in a.chunks_exact(candidate.features()).zip(b.chunks_exact(candidate.features())) {
                forced.round_trip.extend(joints(a).iter().zip(joints(b)).map(|(a, b)| a.distance(b)));
            }
        }
        Ok(forced)
    }

    /// The reference's features of each block through an engine's encoder and decoder: unstandardised features.
    fn through(&self, engine: &Engine, activations: &mut Option<Activations>) -> Result<Vec<Vec<f32>>> {
        let mut exec = engine.exec(1)?;
        exec.listen(activations.take());
        let (mut encoder, mut decoder) = (engine.encoder.state(KvDtype::F16), engine.decoder.state(KvDtype::F16));
        let mut z = vec![0.0; engine.config().vae.latent];
        let mut out = Vec::with_capacity(self.steps.len());
        exec.begin();
        for step in &self.steps {
            let mut x = vec![0.0; step.features.len()];
            engine.encoder.step(&mut exec, &mut encoder, &step.features, &mut z);
            engine.decoder.step(&mut exec, &mut decoder, &z, &mut x);
            engine.pose.restore(&mut x);
            out.push(x);
        }
        exec.end();
        *activations = exec.listen(None);
        Ok(out)
    }
}

impl FrameError {
    /// The difference of two frames.
    pub fn between(a: &Frame, b: &Frame) -> Self {
        let pairs = || a.global.iter().zip(&b.global);
        Self {
            joints: pairs().map(|(a, b)| a.position.distance(b.position)).collect(),
            angles: pairs().map(|(a, b)| angle(a.rotation, b.rotation)).collect(),
            gaze: a.gaze.zip(b.gaze).map(|(a, b)| (a - b).abs()),
        }
    }
}

/// Angle between two rotations, radians; by the sine of its half, which is exact for small angles.
fn angle(a: glam::Quat, b: glam::Quat) -> f32 {
    let d = a.conjugate() * b;
    2.0 * libm::atan2f(d.xyz().length(), d.w.abs())
}
