//! A whole clip of sounds around the agent to motion, with a bundle of the kind `mospa`.
//!
//! Sounds are rendered at the agent's two ears (spherical head, in a room), features of each ear go
//! through the denoiser. The agent stands at the origin facing +Z at frame 0, which is where its
//! ears stay for the rendering.

pub use crate::offline::Sound;

use crate::recording::{Recording, Sounds, Source};
use glam::Vec3;
use std::time::{Duration, Instant};
use visavis::internals::audio::{ears, features};
use visavis::internals::flow::normal;
use visavis::internals::frame::FRAME_SAMPLES;
use visavis::internals::mospa::{Heard, Reactor};
use visavis::{Error, ErrorKind, Result, SAMPLE_RATE};

/// Most sounds of a clip.
pub const MAX_SOUNDS: usize = 16;
/// Noise of the ears, dB SPL, as in training.
const NOISE: f64 = 30.0;
/// First number of the noise of rooms and ears; the motion's counts frames from 0.
const ROOM_NOISE: u64 = 1 << 32;

/// How to react.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// 0 dull, 1 neutral, 2 sensitive; none: the model is not told.
    pub sensitivity: Option<u8>,
    /// Steps of sampling; none: the bundle's.
    pub steps: Option<usize>,
    /// Seed of all noise.
    pub seed: u64,
    /// 1 or 2; the motion is the same.
    pub threads: usize,
}

/// A reaction.
#[derive(Debug)]
pub struct Outcome {
    /// The motion, and what was heard.
    pub recording: Recording,
    /// Steps that sampling took.
    pub steps: usize,
    /// Samples that were louder than the ears take.
    pub clipped: usize,
    /// Which sound the model was told the place of.
    pub told: usize,
    /// Time that features and motion took.
    pub elapsed: Duration,
}

/// Reacts to `sounds`. The model is told one place: that of the sound that is loudest at the head.
///
/// # Errors
/// [`ErrorKind::Argument`] for no sound or more than [`MAX_SOUNDS`], a place that is no number,
/// too far or inside the head, steps or threads out of range; [`ErrorKind::Audio`] for a sound
/// that begins after the clip's end.
pub fn run(reactor: &Reactor, sounds: &[Sound], options: &Options) -> Result<Outcome> {
    if !(1..=MAX_SOUNDS).contains(&sounds.len()) {
        let message = format!("{} sounds: a clip takes 1 to {MAX_SOUNDS}", sounds.len());
        return Err(Error::new(ErrorKind::Argument, message));
    }
    let started = Instant::now();
    let samples = reactor.frames() * FRAME_SAMPLES;
    let rate = f64::from(SAMPLE_RATE);
    let mut next = ROOM_NOISE;
    let mut noise = |out: &mut [f64]| {
        let mut values = vec![0.0; out.len()];
        normal(options.seed, next, &mut values);
        next += 1;
        out.iter_mut().zip(values).for_each(|(o, v)| *o = f64::from(v));
    };
    let mut heard = ears::Ears::new(samples);
    let (mut told, mut loudest) = (0, f64::NEG_INFINITY);
    for (i, sound) in sounds.iter().enumerate() {
        let (place, start) = (sound.place.to_array(), (sound.start * rate).round() as usize);
        let level = heard.add(&sound.samples, start, place, &ears::Room::around(place), &mut noise)?;
        if level > loudest {
            (told, loudest) = (i, level);
        }
    }
    let ([left, right], clipped) = heard.finish(NOISE, &mut noise);
    let steps = options.steps.unwrap_or(reactor.steps());
    let place = (sounds[told].place).as_vec3().to_array();
    let (a, b) = (features::ear(&left)?, features::ear(&right)?);
    let given = Heard { left: &a, right: &b, place: Some(place), genre: options.sensitivity };
    let motion = reactor.motion(&given, &reactor.noise(options.seed), steps, options.threads)?;
    let frames = reactor.poses(&motion)?;
    let elapsed = started.elapsed();
    let end = samples as f64 / rate;
    let source = |sound: &Sound| Source {
        name: sound.name.clone(),
        position: sound.place.as_vec3(),
        seconds: [sound.start, sound.end().min(end)],
    };
    let sounds = Sounds {
        sources: sounds.iter().map(source).collect(),
        heard: left.iter().zip(&right).map(|(l, r)| (0.5 * (l + r)) as f32).collect(),
    };
    let recording = Recording {
        rig: reactor.config().rig.clone(),
        user: vec![None::<Vec3>; frames.len()],
        frames,
        agent_voice: None,
        user_voice: None,
        gaze_target: None,
        sounds: Some(sounds),
    };
    Ok(Outcome { recording, steps, clipped, told, elapsed })
}

#[cfg(test)]
mod tests;
