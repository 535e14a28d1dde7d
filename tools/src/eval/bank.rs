//! Motion that is looked up instead of generated: SARAH's Random and NN (nearest neighbour)
//! baselines.

use super::clip::{Clip, Segment};
use super::window::{WINDOW, Window};
use crate::metrics::envelope;
use visavis::{FPS, Frame, Result};

/// Most stretches that are compared with, as many as SARAH's library holds.
const LIBRARY: usize = 2048;
/// Frames between the values of a key.
const EVERY: usize = 10;
/// Silence, decibels; an absent voice counts as silent.
const SILENCE: f64 = -60.0;
/// A difference of this many decibels counts as much as one of a metre.
const DECIBELS_A_METRE: f64 = 15.0;

/// A library of stretches of motion with what was heard and seen then.
#[derive(Debug)]
pub struct Bank {
    clips: Vec<Clip>,
    /// Clip and first frame, with the key.
    stretches: Vec<(usize, usize, Vec<f64>)>,
    /// Whether the clips are the test clips themselves: then a window's own clip is not looked at.
    own: bool,
}

impl Bank {
    /// A library of at most 2,048 stretches of 400 frames spread evenly over `clips`; `own` tells
    /// that they are the test clips themselves.
    ///
    /// # Errors
    /// Those of [`Clip::read`].
    pub fn new(clips: Vec<Clip>, own: bool) -> Result<Self> {
        let step = WINDOW / 8;
        let starts = |clip: &Clip| (clip.frames() + step).saturating_sub(WINDOW) / step;
        let all: Vec<_> =
            clips.iter().enumerate().flat_map(|(c, clip)| (0..starts(clip)).map(move |i| (c, i * step))).collect();
        let count = all.len().min(LIBRARY);
        let stretch = |i: usize| {
            let (c, from) = all[(2 * i + 1) * all.len() / (2 * count)];
            Ok((c, from, key(&clips[c].read(from, WINDOW)?)))
        };
        let stretches = (0..count).map(stretch).collect::<Result<_>>()?;
        Ok(Self { clips, stretches, own })
    }

    /// Stretches in the library.
    pub fn len(&self) -> usize {
        self.stretches.len()
    }

    /// Whether there is nothing to look up.
    pub fn is_empty(&self) -> bool {
        self.stretches.is_empty()
    }

    /// Any stretch, the same for the same `number`, put where the window's agent stands; `None`
    /// when there is none.
    ///
    /// # Errors
    /// Those of [`Clip::read`].
    pub fn random(&self, window: &Window, number: u64) -> Result<Option<Vec<Frame>>> {
        let of_others: Vec<_> = self.others(window).collect();
        // Fibonacci hashing: evenly spread, not in the order of the clips.
        let at = (number + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) as usize % of_others.len().max(1);
        of_others.get(at).map(|s| self.place(s, window)).transpose()
    }

    /// The stretch whose voices and user are most like the window's, put where the window's agent
    /// stands.
    ///
    /// The distance is the mean of squares over values three times per second: the level of both
    /// voices, and where the user is as the agent sees it at the start.
    ///
    /// # Errors
    /// Those of [`Clip::read`].
    pub fn nearest(&self, window: &Window) -> Result<Option<Vec<Frame>>> {
        let wanted = key(&window.truth);
        let distance = |key: &[f64]| key.iter().zip(&wanted).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let best = self.others(window).min_by(|a, b| distance(&a.2).total_cmp(&distance(&b.2)));
        best.map(|s| self.place(s, window)).transpose()
    }

    fn others<'a>(&'a self, window: &'a Window) -> impl Iterator<Item = &'a (usize, usize, Vec<f64>)> {
        self.stretches.iter().filter(|s| !self.own || s.0 != window.clip)
    }

    fn place(&self, &(clip, from, _): &(usize, usize, Vec<f64>), window: &Window) -> Result<Vec<Frame>> {
        let segment = self.clips[clip].read(from, WINDOW)?;
        Ok(segment.moved(&window.truth.frames[0].root))
    }
}

/// What was heard and seen: two levels and two coordinates, three times per second.
fn key(segment: &Segment) -> Vec<f64> {
    let level = |voice: Option<Vec<f32>>| -> Vec<f64> {
        let levels = envelope(&voice.unwrap_or_default(), segment.frames.len());
        let decibels = |part: &[f64]| {
            let power = part.iter().map(|l| l * l).sum::<f64>() / part.len() as f64;
            10.0 * power.max(1e-12).log10()
        };
        levels.chunks(EVERY).map(|part| decibels(part).max(SILENCE) / DECIBELS_A_METRE).collect()
    };
    let root = segment.frames[0].root;
    let places = segment.user.iter().step_by(EVERY).map(|p| root.to_local(*p));
    let mut key: Vec<f64> = places.flat_map(|p| [f64::from(p.x), f64::from(p.z)]).collect();
    key.extend(level(segment.agent()));
    key.extend(level(segment.user()));
    debug_assert_eq!(key.len(), 4 * segment.frames.len().div_ceil(EVERY), "{FPS} frames a second");
    key
}
