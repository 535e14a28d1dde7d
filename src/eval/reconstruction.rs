//! What the autoencoder loses.

use super::figures::mean;
use super::parallel::each;
use super::window::{LEAD, Window};
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, FPS, Frame};
use crate::kernels::KvDtype;
use crate::metrics::{Space, ape};
use crate::normaliser::{Metric, Standardised};
use crate::pose::{Decoder, Encoder};
use crate::vae::RoundTrip;
use glam::Vec3;
use serde::Serialize;

/// Errors of motion that went through encoder and decoder, means over joints and frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reconstruction {
    /// Joint positions in the root's frame, metres.
    pub joints: f64,
    /// Both hands, metres.
    pub hands: f64,
    /// Both feet, metres.
    pub feet: f64,
    /// Joint rotations in the root's frame, degrees.
    pub rotation: f64,
    /// The root's place after one second of its steps, metres.
    pub root: f64,
}

impl Reconstruction {
    /// Over the windows; what leads in to each fills the networks' memory.
    pub(super) fn measure(engine: &Engine, windows: &[Window], threads: usize) -> Result<Self> {
        let results = each(threads, windows.len(), &|_| {}, &|i| Self::of(engine, &windows[i]))?;
        let average = |value: fn(&Self) -> f64| mean(results.iter().map(value)).unwrap_or(0.0);
        Ok(Self {
            joints: average(|r| r.joints),
            hands: average(|r| r.hands),
            feet: average(|r| r.feet),
            rotation: average(|r| r.rotation),
            root: average(|r| r.root),
        })
    }

    fn of(engine: &Engine, window: &Window) -> Result<Self> {
        let rig = &engine.config.rig;
        let frames = &window.segment.frames;
        let made = through(engine, frames)?;
        let (made, truth) = (&made[LEAD..], &frames[LEAD..made.len()]);
        let errors = ape(made, truth, Space::Root)?;
        let of =
            |names: [&str; 2]| mean(names.iter().filter_map(|name| Some(errors[rig.index(name)?]))).unwrap_or_default();
        let angles = made.iter().zip(truth).flat_map(|(a, b)| {
            let (turn_a, turn_b) = (a.root.rotation().inverse(), b.root.rotation().inverse());
            let pairs = a.global.iter().zip(&b.global);
            pairs.map(move |(a, b)| {
                let (a, b) = (turn_a * a.rotation, turn_b * b.rotation);
                2.0 * f64::from(a.dot(b).abs().min(1.0)).acos().to_degrees()
            })
        });
        let second = FPS as usize;
        let step = |frames: &[Frame], i: usize| {
            let to = frames[i + second].root;
            frames[i].root.to_local(Vec3::new(to.x as f32, 0.0, to.z as f32))
        };
        let drift = (0..made.len() - second).map(|i| f64::from(step(made, i).distance(step(truth, i))));
        Ok(Self {
            joints: mean(errors.iter().copied()).unwrap_or(0.0),
            hands: of(["leftHand", "rightHand"]),
            feet: of(["leftFoot", "rightFoot"]),
            rotation: mean(angles).unwrap_or(0.0),
            root: mean(drift).unwrap_or(0.0),
        })
    }
}

/// Frames through encoder and decoder, as decoded: borders are not bridged and feet not held.
fn through(engine: &Engine, frames: &[Frame]) -> Result<Vec<Frame>> {
    let rig = &engine.config.rig;
    let radius = engine.config.pose.radius;
    let width = engine.features();
    let mut exec = engine.exec(1)?;
    let mut networks = RoundTrip::new(engine.encoder()?, &engine.decoder, engine.config.vae.latent, KvDtype::F32);
    let (mut features, mut motion) = (Encoder::new(radius), Decoder::new(engine.kernels, rig, radius));
    motion.reset(frames.first().map(|f| f.root).unwrap_or_default());
    let mut metric = Metric::zeros(BLOCK_FRAMES * width);
    let [mut x, mut y] = [(); 2].map(|()| Standardised::zeros(BLOCK_FRAMES * width));
    let mut out = Vec::with_capacity(frames.len());
    let mut block = vec![Frame::empty(rig.len()); BLOCK_FRAMES];
    exec.begin();
    for four in frames.chunks_exact(BLOCK_FRAMES) {
        for (i, frame) in four.iter().enumerate() {
            features.encode(frame.root, &frame.global, metric.part_mut(i..i + 1, width));
        }
        engine.pose.standardise(metric.view(), x.view_mut());
        networks.step(&mut exec, x.view(), y.view_mut());
        engine.pose.restore(y.view(), metric.view_mut());
        motion.decode_block(metric.view(), &mut block)?;
        out.extend(block.iter().cloned());
    }
    exec.end();
    Ok(out)
}
