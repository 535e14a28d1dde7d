//! Teacher-forced comparison: what another engine makes of each block, given the history that a
//! reference engine made.
//!
//! The reference is a session that runs freely over a scene: what it is told, free gaze included,
//! is what any session with these options is told. The candidate is a session too, and computes
//! every block from the reference's past: the same latents behind it (through its own weights), or
//! of the kind `dram` the same memory, the same root and posture, the same noise, the same user. So
//! the difference is that of one block, and does not grow. Its voices go through its own audio
//! encoder, and, where the bundles hear, the scene's sounds through all that hears. Neither
//! re-anchors.

use super::argument;
use super::scene::Scene;
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{Frame, Sampler};
use crate::kernels::{Activations, KvDtype};
use crate::normaliser::{Metric, Standardised};
use crate::pose;
use crate::session::{Anchoring, MadeBlock, Session, SessionOptions};
use crate::vae::RoundTrip;
use glam::Vec3;
use std::sync::Arc;

/// A reference engine's run over a scene, which candidates are compared with.
pub struct Teacher {
    engine: Arc<Engine>,
    scene: Scene,
    options: SessionOptions,
    /// How the reference stood before its first block, and its blocks.
    start: MadeBlock,
    blocks: Vec<MadeBlock>,
    /// The reference's features encoded and decoded again; of the kind `dram` none.
    round_trip: Vec<Metric>,
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
    /// The reference's latents and the candidate's, standardised, block after block; of the kind
    /// `dram` their poses.
    pub latents: [Vec<f32>; 2],
    /// The reference's decoded features encoded and decoded again, joints against those of the
    /// reference's encoder and decoder: metres, joint after joint, frame after frame; of the kind
    /// `dram` empty.
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

impl Teacher {
    /// Runs `engine` over `scene`; `activations` listens to its layers.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) for a sampler that the bundle has
    /// no network for.
    pub fn new(
        engine: &Arc<Engine>,
        scene: Scene,
        sampler: Sampler,
        seed: u64,
        activations: &mut Option<Activations>,
    ) -> Result<Self> {
        let options = SessionOptions {
            seed,
            sampler,
            gaze: scene.gaze(),
            diagnostics: Anchoring::Never.into(),
            ..SessionOptions::default()
        };
        let mut session = Session::listened(Arc::clone(engine), options.clone(), activations.take())?;
        let start = session.made();
        let mut blocks = Vec::with_capacity(scene.blocks());
        scene.play(&mut session, |session, _| {
            blocks.push(session.made());
            Ok(())
        })?;
        *activations = session.stop_listening();
        let own = Arc::clone(engine);
        let mut this = Self { engine: own, scene, options, start, blocks, round_trip: Vec::new() };
        if engine.sarah().is_ok() {
            this.round_trip = this.through(engine, activations)?;
        }
        Ok(this)
    }

    /// The sampler.
    pub fn sampler(&self) -> Sampler {
        self.options.sampler
    }

    /// What the reference's session was made with.
    pub fn options(&self) -> &SessionOptions {
        &self.options
    }

    /// The reference's frames, block after block.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.blocks.iter().flat_map(|block| &block.frames)
    }

    /// What `candidate` makes of every block.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) when it has another rig or other
    /// sizes than the reference, or tells its sessions something else (calibration of gaze,
    /// guidance, temperature).
    pub fn compare(&self, candidate: &Arc<Engine>) -> Result<Forced> {
        let (a, b) = (self.engine.config(), candidate.config());
        let sizes = (&a.rig, a.vae, a.flow, &a.dram, &a.audio, &a.hearing);
        if sizes != (&b.rig, b.vae, b.flow, &b.dram, &b.audio, &b.hearing) {
            return Err(argument("the candidate is not made from the reference: rig or sizes differ".to_owned()));
        }
        if (&a.session, &a.gaze) != (&b.session, &b.gaze) {
            let message = "the candidate is not made from the reference as it is: defaults of sessions or the calibration of gaze \
                           differ; calibrate first, then quantise";
            return Err(argument(message.to_owned()));
        }
        let mut session = Session::listened(Arc::clone(candidate), self.options.clone(), None)?;
        match self.engine.sarah() {
            Ok(sarah) => session.reset_to(sarah.idle.view()),
            Err(_) => session.follow(&self.start),
        }
        let mut forced = Forced { frames: Vec::new(), latents: [Vec::new(), Vec::new()], round_trip: Vec::new() };
        self.scene.play(&mut session, |session, block| {
            let (taught, made) = (&self.blocks[block], session.made());
            forced.latents[0].extend_from_slice(taught.output());
            forced.latents[1].extend_from_slice(made.output());
            forced.frames.extend(taught.frames.iter().zip(&made.frames).map(|(a, b)| FrameError::between(a, b)));
            session.follow(taught);
            Ok(())
        })?;
        let Ok(sarah) = candidate.sarah() else { return Ok(forced) };
        let radius = a.pose.radius;
        let joints = |x: &[f32]| -> Vec<Vec3> {
            let (_, joints) = x.split_at(crate::frame::ROOT_CHANNELS);
            let vertices = joints.as_chunks::<{ crate::frame::JOINT_CHANNELS }>().0;
            vertices.iter().map(|v| pose::icosahedron::decode(v, radius).0).collect()
        };
        let width = sarah.features();
        for (a, b) in self.round_trip.iter().zip(self.through(candidate, &mut None)?) {
            for (a, b) in a.values().chunks_exact(width).zip(b.values().chunks_exact(width)) {
                forced.round_trip.extend(joints(a).iter().zip(joints(b)).map(|(a, b)| a.distance(b)));
            }
        }
        Ok(forced)
    }

    /// The reference's features of each block through an engine's encoder and decoder.
    fn through(&self, engine: &Engine, activations: &mut Option<Activations>) -> Result<Vec<Metric>> {
        let mut exec = engine.exec(1)?;
        exec.listen(activations.take());
        let latent = engine.config().vae.latent;
        let mut networks = RoundTrip::new(engine.encoder()?, &engine.sarah()?.decoder, latent, KvDtype::F16);
        let mut out = Vec::with_capacity(self.blocks.len());
        exec.begin();
        for block in &self.blocks {
            let len = block.features.values().len();
            let (mut x, mut metric) = (Standardised::zeros(len), Metric::zeros(len));
            networks.step(&mut exec, block.features.view(), x.view_mut());
            engine.sarah()?.pose.restore(x.view(), metric.view_mut());
            out.push(metric);
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
