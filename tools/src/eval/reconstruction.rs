//! What the autoencoder loses.

use super::figures::mean;
use super::parallel::each;
use super::window::{LEAD, Window};
use crate::metrics::{Space, ape};
use glam::Vec3;
use serde::Serialize;
use visavis::{Engine, FPS, Frame, Result};

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
        let rig = engine.rig();
        let frames = &window.segment.frames;
        let made = engine.round_trip(frames)?;
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
