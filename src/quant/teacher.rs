//! Teacher-forced comparison: what another engine makes of each block, given the history that a reference engine made.
//!
//! The reference runs freely over a scene. The candidate then computes every block from the reference's past: the same latents
//! behind it (through its own weights), the same root and posture, the same noise, the same user. So the difference is that of one
//! block, and does not grow. Its voices go through its own audio encoder. Neither re-anchors.

use super::argument;
use super::scene::Scene;
use super::walker::Walker;
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{Frame, Sampler};
use crate::kernels::{Activations, KvDtype};
use crate::pose;
use glam::Vec3;

/// A block of the reference.
pub(super) struct Step {
    pub(super) z: Vec<f32>,
    features: Vec<f32>,
    pub(super) after: pose::Decoder,
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
        let mut steps = Vec::with_capacity(scene.blocks());
        for block in 0..scene.blocks() {
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
        let (mut encoder, mut decoder) = (engine.encoder()?.state(KvDtype::F16), engine.decoder.state(KvDtype::F16));
        let mut z = vec![0.0; engine.config().vae.latent];
        let mut out = Vec::with_capacity(self.steps.len());
        exec.begin();
        for step in &self.steps {
            let mut x = vec![0.0; step.features.len()];
            engine.encoder()?.step(&mut exec, &mut encoder, &step.features, &mut z);
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
