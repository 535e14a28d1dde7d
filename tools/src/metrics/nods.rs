//! Nods of a listener: how many, and how long after the other's phrases.

use super::liveliness::{gaussian, runs};
use super::{RATE, joint};
use serde::{Deserialize, Serialize};
use visavis::{Frame, Rig};

/// Least dip of the head, and least way back, radians (2 degrees).
const LEAST: f64 = 0.035;
/// Frames that each of them takes, at least and at most.
const TAKES: std::ops::RangeInclusive<usize> = 4..=18;
/// Dips that follow each other within this many frames are one nod.
const ONE: usize = 24;
/// A user pauses for up to this long after a phrase, frames; nods within it, or this half before,
/// have a lag.
const PAUSE: usize = 60;

/// Nods by what the user does, while the agent is silent.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Nods {
    /// A minute of the user's speech.
    pub speaks: Option<f64>,
    /// A minute of the two seconds after a phrase.
    pub pauses: Option<f64>,
    /// A minute when nobody has spoken for two seconds: what is counted there answers nobody.
    pub nobody: Option<f64>,
    /// Median time from the nearest end of a phrase, seconds.
    pub lag: Option<f64>,
}

/// Counts over stretches of motion.
#[derive(Debug, Clone, Default)]
pub struct NodTally {
    counts: [(usize, usize); 3],
    lags: Vec<f64>,
}

impl NodTally {
    /// Adds a motion; `agent` and `user` tell in which frames each speaks.
    pub fn add(&mut self, rig: &Rig, frames: &[Frame], agent: &[bool], user: &[bool]) {
        let Some(head) = joint(rig, "head") else { return };
        let pitch: Vec<f64> = frames
            .iter()
            .map(|f| {
                let ahead = (f.global[head].rotation * glam::Vec3::Z).as_dvec3();
                (-ahead.y).atan2(ahead.x.hypot(ahead.z))
            })
            .collect();
        let ends: Vec<usize> = runs(user).map(|(_, end)| end).collect();
        let state = |i: usize| {
            let paused = ends.iter().any(|&end| (end..end + PAUSE).contains(&i));
            (!agent[i]).then_some(if user[i] {
                0
            } else if paused {
                1
            } else {
                2
            })
        };
        for i in 0..frames.len() {
            if let Some(state) = state(i) {
                self.counts[state].1 += 1;
            }
        }
        for at in nods(&pitch) {
            let Some(state) = state(at) else { continue };
            self.counts[state].0 += 1;
            let lag = |&end: &usize| (at as f64 - end as f64) / RATE;
            let near = ends.iter().map(lag).filter(|lag| (-1.0..2.0).contains(lag));
            self.lags.extend(near.min_by(|a, b| a.abs().total_cmp(&b.abs())));
        }
    }

    /// Adds what another tally has.
    pub fn merge(&mut self, other: Self) {
        for (own, more) in self.counts.iter_mut().zip(other.counts) {
            own.0 += more.0;
            own.1 += more.1;
        }
        self.lags.extend(other.lags);
    }

    /// The measures.
    pub fn row(&self) -> Nods {
        let rate = |i: usize| {
            let (count, frames) = self.counts[i];
            (frames > 0).then(|| count as f64 * 60.0 * RATE / frames as f64)
        };
        let mut lags = self.lags.clone();
        lags.sort_by(f64::total_cmp);
        Nods { speaks: rate(0), pauses: rate(1), nobody: rate(2), lag: lags.get(lags.len() / 2).copied() }
    }
}

/// Frames at which nods begin, of the head's pitch (down positive, radians): it dips and comes
/// back, soon and far enough.
fn nods(pitch: &[f64]) -> Vec<usize> {
    let slow = gaussian(pitch, 15.0);
    let fast = gaussian(&pitch.iter().zip(slow).map(|(p, s)| p - s).collect::<Vec<_>>(), 1.0);
    let turns: Vec<usize> = (1..fast.len().saturating_sub(1))
        .filter(|&i| (fast[i] - fast[i - 1]) * (fast[i + 1] - fast[i]) < 0.0)
        .collect();
    let (mut out, mut last) = (Vec::new(), None::<usize>);
    for three in turns.windows(3) {
        let &[a, b, c] = three else { continue };
        let deep = fast[b] - fast[a] >= LEAST && fast[b] - fast[c] >= LEAST;
        if deep && TAKES.contains(&(b - a)) && TAKES.contains(&(c - b)) {
            if last.is_none_or(|last| a > last + ONE) {
                out.push(a);
            }
            last = Some(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;
    use std::f64::consts::TAU;

    fn pitch(of: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..900).map(|i| of(f64::from(i) / 30.0)).collect()
    }

    fn nod(t: f64) -> f64 {
        if (10.0..11.0).contains(&t) { 0.05 * (1.0 - (TAU * 2.0 * (t - 10.0)).cos()) } else { 0.0 }
    }

    #[test]
    fn nods_are_found_and_nothing_else_is() {
        let found = nods(&pitch(nod));
        assert!(found.len() == 1 && found[0].abs_diff(300) < 6, "{found:?}");
        assert!(nods(&pitch(|t| 0.3 * (TAU * 0.1 * t).sin())).is_empty(), "slow looking up and down");
        assert!(nods(&pitch(|t| if t > 10.0 { 0.3 } else { 0.0 })).is_empty(), "a look down");
        assert!(nods(&pitch(|t| 0.2 * nod(t))).is_empty());
    }

    #[test]
    fn a_nod_after_a_phrase_has_its_lag() {
        let mut r = recording(900, |_, _, _| {});
        for (frame, p) in r.frames.iter_mut().zip(pitch(nod)) {
            frame.global[1].rotation = glam::Quat::from_rotation_x(p as f32);
        }
        let user: Vec<bool> = (0..900).map(|i| (200..291).contains(&i)).collect();
        let mut tally = NodTally::default();
        tally.add(&r.rig, &r.frames, &[false; 900], &user);
        let row = tally.row();
        close(row.lag.unwrap(), 0.3, 0.2);
        close(row.pauses.unwrap(), 30.0, 1e-9);
        assert_eq!((row.speaks, row.nobody), (Some(0.0), Some(0.0)));
        let mut twice = tally.clone();
        twice.merge(tally);
        assert_eq!(twice.row().pauses, row.pauses);
        let mut talks = NodTally::default();
        talks.add(&r.rig, &r.frames, &[true; 900], &user);
        assert_eq!(talks.row(), Nods::default());
    }
}
