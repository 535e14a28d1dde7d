//! What two ears hear of sounds somewhere: spherical head, distance, first reflections of a room
//! and a short diffuse tail (`training/visavis_train/mospa/ears.py` is mirrored here).
//!
//! Samples are pascals at 24 kHz, within +-1: RMS 1 is 94 dB SPL. The head's centre is 1.6 m
//! above the origin, it faces +Z, the left ear is at +X.

use super::fft::{Complex, Fft};
use super::head::{self, NEAREST, SPEED, around, brightness};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::SAMPLE_RATE;
use std::f64::consts::TAU;

/// Height of the head's centre, metres.
pub const HEAD_HEIGHT: f64 = 1.6;
/// Radius of the head, metres; a source inside is refused.
pub const HEAD_RADIUS: f64 = head::RADIUS;
/// Farthest coordinate of a source, metres.
pub const FARTHEST: f64 = 100.0;
/// Longest tail, and what rings on after a sound: half a second.
const RING: usize = SAMPLE_RATE as usize / 2;

/// A room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// Walls x, floor y and walls z on the negative sides, metres; infinity: none.
    pub low: [f64; 3],
    /// Those on the positive sides.
    pub high: [f64; 3],
    /// Share of the amplitude that they reflect.
    pub reflect: f64,
    /// Time in which the tail falls by 60 dB, seconds, at most 0.5.
    pub fall: f64,
    /// Amplitude of the tail at its start, relative to the direct sound at 1 m.
    pub tail: f64,
}

impl Room {
    /// The middle one of those that the model was trained in: 1.6 m of room around the head and the
    /// source; without a ceiling where the source is higher than 2.3 m.
    pub fn around(source: [f64; 3]) -> Self {
        let mut room = Self { low: [0.0; 3], high: [0.0; 3], reflect: 0.4, fall: 0.3, tail: 0.0125 };
        for axis in [0, 2] {
            room.low[axis] = source[axis].min(0.0) - 1.6;
            room.high[axis] = source[axis].max(0.0) + 1.6;
        }
        room.high[1] = if source[1] < 2.3 { 2.8 } else { f64::INFINITY };
        room
    }

    /// The source and its mirror images of the first order, with their gains.
    fn images(&self, source: [f64; 3]) -> Vec<([f64; 3], f64)> {
        let mut out = vec![(source, 1.0)];
        for axis in 0..3 {
            for wall in [self.low[axis], self.high[axis]].into_iter().filter(|wall| wall.is_finite()) {
                let mut mirrored = source;
                mirrored[axis] = 2.0 * wall - source[axis];
                out.push((mirrored, self.reflect));
            }
        }
        out
    }
}

/// How a place is heard: distance in metres, delay in seconds and high-frequency gain of both ears.
fn paths(place: [f64; 3]) -> (f64, [f64; 2], [f64; 2]) {
    let d = [place[0], place[1] - HEAD_HEIGHT, place[2]];
    let r = d.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-6);
    let angles = [d[0] / r, -d[0] / r].map(|cosine| libm::acos(cosine.clamp(-1.0, 1.0)));
    let r = r.max(NEAREST);
    (r, angles.map(|angle| (r + HEAD_RADIUS * around(angle)) / SPEED), angles.map(brightness))
}

/// Fails for a place where no source can be.
///
/// # Errors
/// [`ErrorKind::Argument`]: not a number, farther than [`FARTHEST`] along an axis, inside the head.
pub fn check_place(place: [f64; 3]) -> Result<()> {
    let refused = |why: String| Err(Error::new(ErrorKind::Argument, format!("the source at {place:?} {why}")));
    if !place.iter().all(|v| v.abs() <= FARTHEST) {
        return refused(format!("is not within {FARTHEST} m; positions are metres, numbers only"));
    }
    let d = [place[0], place[1] - HEAD_HEIGHT, place[2]];
    if d.iter().map(|v| v * v).sum::<f64>() < HEAD_RADIUS * HEAD_RADIUS {
        return refused(format!("is inside the agent's head, which is {HEAD_HEIGHT} m above the origin; move it out"));
    }
    Ok(())
}

/// What both ears have heard so far, over one stretch of time.
#[derive(Debug)]
pub struct Ears {
    samples: usize,
    fft: Fft,
    /// Spectrum of left + i right.
    heard: Vec<Complex>,
}

impl Ears {
    /// Silence of `samples` samples.
    pub fn new(samples: usize) -> Self {
        let size = (samples + RING).next_power_of_two();
        Self { samples, fft: Fft::new(size), heard: vec![Complex::default(); size] }
    }

    /// Adds a source at `place`, which makes `sound` (as it is 1 m from it) from sample `start` on;
    /// `normal` draws the room's tail. Returns the level at the head, RMS of the direct sound over
    /// the stretch.
    ///
    /// # Errors
    /// Those of [`check_place`]; [`ErrorKind::Audio`] where a sample is no number, or nothing
    /// sounds within the stretch.
    pub fn add(
        &mut self,
        sound: &[f32],
        start: usize,
        place: [f64; 3],
        room: &Room,
        normal: &mut dyn FnMut(&mut [f64]),
    ) -> Result<f64> {
        check_place(place)?;
        if let Some(i) = sound.iter().position(|v| !v.is_finite()) {
            return Err(Error::new(ErrorKind::Audio, format!("sample {i} of the sound is {}, no number", sound[i])));
        }
        if sound.is_empty() || start >= self.samples {
            let message = "the sound has no samples within the motion; start it earlier, or give one that has some";
            return Err(Error::new(ErrorKind::Audio, message));
        }
        let size = self.fft.size();
        let mut made = vec![Complex::default(); size];
        for (made, v) in made[start..self.samples].iter_mut().zip(sound) {
            made.re = f64::from(*v);
        }
        let energy = made.iter().map(|v| v.power()).sum::<f64>() / self.samples as f64;
        self.fft.forward(&mut made);
        let mut response = self.tail(place, room, normal);
        self.responses(place, room, &mut response);
        for (heard, (made, response)) in self.heard.iter_mut().zip(made.iter().zip(&response)) {
            *heard = *heard + *made * *response;
        }
        Ok(energy.sqrt() / paths(place).0)
    }

    /// Spectrum of the diffuse tail, left + i right.
    fn tail(&self, place: [f64; 3], room: &Room, normal: &mut dyn FnMut(&mut [f64])) -> Vec<Complex> {
        let length = ((f64::from(SAMPLE_RATE) * room.fall) as usize).min(RING);
        let (mut left, mut right) = (vec![0.0; length], vec![0.0; length]);
        normal(&mut left);
        normal(&mut right);
        let [a, b] = paths(place).1;
        let first = (f64::from(SAMPLE_RATE) * (a.min(b) + 0.004)) as usize;
        let mut tail = vec![Complex::default(); self.fft.size()];
        let ears = left.iter().zip(&right).enumerate();
        for (out, (i, (l, r))) in tail.iter_mut().skip(first).zip(ears) {
            let fall = libm::exp(-6.9 * i as f64 / length as f64) * room.tail;
            *out = Complex::new(l * fall, r * fall);
        }
        self.fft.forward(&mut tail);
        tail
    }

    /// Adds the responses of both ears to the source and its images, left + i right.
    fn responses(&self, place: [f64; 3], room: &Room, out: &mut [Complex]) {
        let half = self.fft.size() / 2;
        let images: Vec<_> = room.images(place).into_iter().map(|(place, gain)| (paths(place), gain)).collect();
        for k in 0..=half {
            let omega = TAU * k as f64 * f64::from(SAMPLE_RATE) / self.fft.size() as f64;
            let bend = omega * HEAD_RADIUS / (2.0 * SPEED);
            let scale = 1.0 / (1.0 + bend * bend);
            let mut ears = [Complex::default(); 2];
            for ((r, delay, high), gain) in &images {
                for (ear, (delay, high)) in ears.iter_mut().zip(delay.iter().zip(high)) {
                    // (1 + i high bend) / (1 + i bend)
                    let filter = Complex::new(1.0 + high * bend * bend, (high - 1.0) * bend);
                    let level = gain / r * scale;
                    let turn = Complex::turn(-omega * delay);
                    *ear = *ear + Complex::new(level * turn.re, level * turn.im) * filter;
                }
            }
            let [left, right] = ears;
            if k == 0 || k == half {
                // Real signals have real values there.
                out[k] = out[k] + Complex::new(left.re, right.re);
                continue;
            }
            out[k] = out[k] + left + Complex::new(-right.im, right.re);
            let (left, right) = (left.conj(), right.conj());
            let mirror = &mut out[2 * half - k];
            *mirror = *mirror + left + Complex::new(-right.im, right.re);
        }
    }

    /// Samples of the left and of the right ear, with noise of `noise` dB SPL (minus infinity:
    /// none), clipped to +-1; and how many of them were clipped.
    pub fn finish(mut self, noise: f64, normal: &mut dyn FnMut(&mut [f64])) -> ([Vec<f64>; 2], usize) {
        self.fft.inverse(&mut self.heard);
        let level = libm::pow(10.0, (noise - 94.0) / 20.0);
        let mut clipped = 0;
        let ears = [|v: &Complex| v.re, |v: &Complex| v.im].map(|ear| {
            let mut out = vec![0.0; self.samples];
            normal(&mut out);
            for (out, heard) in out.iter_mut().zip(&self.heard) {
                let sum = ear(heard) + level * *out;
                clipped += usize::from(sum.abs() > 1.0);
                *out = sum.clamp(-1.0, 1.0);
            }
            out
        });
        (ears, clipped)
    }
}

#[cfg(test)]
mod tests;
