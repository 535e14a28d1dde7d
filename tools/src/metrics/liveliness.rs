//! How lively a body is at rest: stillness, speeds, changes of the hands' rest place, sway,
//! spectra.
//!
//! Hands and head are measured relative to the hips, smoothed by a 9-frame Hann window, lengths
//! scaled to a head joint at 1.6 m. Both hands are *still* when slower than 3 cm/s. *Rest change*:
//! the mean place of a hand over 2 s moves by more than 10 cm from one such window to the next.
//! *Sway*: sum of the standard deviations of the hips over the feet, both axes of the hips'
//! heading, in 30 s. The corpus and recordings of people are measured alike (`corpus/measures.py`).

use super::{RATE, joint};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use visavis::{Frame, Rig};

/// Height to which the head joint is scaled, metres.
const HEAD_HEIGHT: f64 = 1.6;
/// Hands slower than this are still, m/s.
const STILL: f64 = 0.03;
/// Shortest still stretch that counts, frames.
const LEAST: usize = 6;
/// Stretches of which it is told whether they are all stillness, or none, frames: 10 s.
const SPELL: usize = 300;
/// Shares of a stretch that are still nearly throughout, and nearly never.
const SHARES: [f64; 2] = [0.95, 0.1];
/// Rest windows (2 s), sway windows (30 s), windows of the spectra, frames.
const REST: usize = 60;
const SWAY: usize = 900;
const SPECTRUM: usize = 256;
/// A hand that moves further between rest windows has changed its place, metres.
const CHANGED: f64 = 0.1;
/// Edges of the spectra's bands, Hz.
pub const BANDS: [f64; 6] = [0.2, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Measures of one kind of stretch; `None` where nothing was long enough.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Liveliness {
    /// Seconds that were measured.
    pub seconds: f64,
    /// Share of time with both hands still.
    pub stillness: Option<f64>,
    /// Mean speed of the hands, m/s.
    pub hand_speed: Option<f64>,
    /// Mean acceleration of the hands, m/s².
    pub hand_acceleration: Option<f64>,
    /// Mean speed of the head, m/s.
    pub head_speed: Option<f64>,
    /// Mean acceleration of the head, m/s².
    pub head_acceleration: Option<f64>,
    /// Changes of a hand's rest place, both hands together, a minute.
    pub rest_changes: Option<f64>,
    /// Sway, centimetres.
    pub sway: Option<f64>,
    /// Still stretches of 0.2 s or more, a minute.
    pub still_stretches: Option<f64>,
    /// Share of stretches of ten seconds that are still nearly throughout (above 0.95), and nearly
    /// never (below 0.1): people are both, one after the other.
    #[serde(default)]
    pub still_throughout: Option<f64>,
    /// See `still_throughout`.
    #[serde(default)]
    pub still_never: Option<f64>,
    /// Root of the power of the hands' speed in each of [`BANDS`], m/s.
    pub hand_spectrum: Vec<f64>,
    /// The same of the head's speed.
    pub head_spectrum: Vec<f64>,
}

/// Sums over stretches of motion, of which [`Tally::row`] makes the measures.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    frames: usize,
    still: usize,
    hand: [f64; 2],
    head: [f64; 2],
    changes: usize,
    pairs: usize,
    stretches: usize,
    spells: usize,
    spent: [usize; 2],
    sway: Vec<f64>,
    spectra: [Vec<Vec<f64>>; 2],
}

impl Tally {
    /// Adds the frames under `mask`, one value a frame. A rig without head, hands and feet adds
    /// nothing.
    pub fn add(&mut self, rig: &Rig, frames: &[Frame], mask: &[bool]) {
        let Some(tracks) = Tracks::of(rig, frames) else { return };
        let still: Vec<bool> = tracks.hands.iter().map(|h| h.speed.iter().all(|&v| v < STILL)).collect();
        for i in 1..frames.len().saturating_sub(1) {
            if mask[i] {
                self.frames += 1;
                self.still += usize::from(still[i]);
                let hands = &tracks.hands[i];
                for k in 0..2 {
                    self.hand[k] += hands.speed_and_acceleration(k);
                    self.head[k] += tracks.head[i][k];
                }
            }
        }
        for (from, to) in runs(mask) {
            self.stretches += runs(&still[from..to]).filter(|(a, b)| b - a >= LEAST).count();
            for spell in still[from..to].chunks_exact(SPELL) {
                let share = spell.iter().filter(|still| **still).count() as f64 / SPELL as f64;
                self.spells += 1;
                self.spent[0] += usize::from(share > SHARES[0]);
                self.spent[1] += usize::from(share < SHARES[1]);
            }
            let place = |window: usize, hand: usize| -> DVec3 {
                let at = from + window * REST;
                tracks.hands[at..at + REST].iter().map(|h| h.place[hand]).sum::<DVec3>() / REST as f64
            };
            for window in 1..(to - from) / REST {
                self.pairs += 1;
                let moved = |&hand: &usize| place(window, hand).distance(place(window - 1, hand)) > CHANGED;
                self.changes += (0..2).filter(moved).count();
            }
            for over in tracks.over[from..to].chunks_exact(SWAY) {
                self.sway.push(deviation(over.iter().map(|p| p.x)) + deviation(over.iter().map(|p| p.y)));
            }
            let mut at = from;
            while at + SPECTRUM <= to {
                let part = at..at + SPECTRUM;
                let hands: Vec<_> = tracks.hands[part.clone()].iter().map(|h| h.speed_and_acceleration(0)).collect();
                let head: Vec<_> = tracks.head[part].iter().map(|h| h[0]).collect();
                self.spectra[0].push(power(&hands));
                self.spectra[1].push(power(&head));
                at += SPECTRUM / 2;
            }
        }
    }

    /// Adds what another tally has.
    pub fn merge(&mut self, other: Self) {
        self.frames += other.frames;
        self.still += other.still;
        for k in 0..2 {
            self.hand[k] += other.hand[k];
            self.head[k] += other.head[k];
        }
        self.changes += other.changes;
        self.pairs += other.pairs;
        self.stretches += other.stretches;
        self.spells += other.spells;
        for k in 0..2 {
            self.spent[k] += other.spent[k];
        }
        self.sway.extend(other.sway);
        for (own, more) in self.spectra.iter_mut().zip(other.spectra) {
            own.extend(more);
        }
    }

    /// All of `tallies` together.
    pub fn sum(tallies: impl IntoIterator<Item = Self>) -> Self {
        let mut all = Self::default();
        tallies.into_iter().for_each(|tally| all.merge(tally));
        all
    }

    /// The measures.
    pub fn row(&self) -> Liveliness {
        let share = |sum: f64, n: usize| (n > 0).then(|| sum / n as f64);
        let minutes = |frames: usize| frames as f64 / RATE / 60.0;
        let a_minute = |count: usize, frames: usize| (frames > 0).then(|| count as f64 / minutes(frames));
        Liveliness {
            seconds: self.frames as f64 / RATE,
            stillness: share(self.still as f64, self.frames),
            hand_speed: share(self.hand[0], self.frames),
            hand_acceleration: share(self.hand[1], self.frames),
            head_speed: share(self.head[0], self.frames),
            head_acceleration: share(self.head[1], self.frames),
            rest_changes: a_minute(self.changes, self.pairs * REST),
            sway: share(100.0 * self.sway.iter().sum::<f64>(), self.sway.len()),
            still_stretches: a_minute(self.stretches, self.frames),
            still_throughout: share(self.spent[0] as f64, self.spells),
            still_never: share(self.spent[1] as f64, self.spells),
            hand_spectrum: bands(&self.spectra[0]),
            head_spectrum: bands(&self.spectra[1]),
        }
    }
}

/// Both hands in one frame.
struct Hands {
    place: [DVec3; 2],
    speed: [f64; 2],
    acceleration: [f64; 2],
}

impl Hands {
    /// Mean of both hands: 0 their speed, 1 their acceleration.
    fn speed_and_acceleration(&self, k: usize) -> f64 {
        let values = if k == 0 { self.speed } else { self.acceleration };
        0.5 * (values[0] + values[1])
    }
}

/// Per-frame quantities of a motion.
struct Tracks {
    hands: Vec<Hands>,
    /// Speed and acceleration of the head.
    head: Vec<[f64; 2]>,
    /// Hips over the middle of the feet, in the hips' smoothed heading.
    over: Vec<DVec2>,
}

impl Tracks {
    fn of(rig: &Rig, frames: &[Frame]) -> Option<Self> {
        let find = |name| joint(rig, name);
        let (head, hands) = (find("head")?, [find("leftHand")?, find("rightHand")?]);
        let feet = [find("leftFoot")?, find("rightFoot")?];
        let mut height = 0.0;
        let mut at = Some(head);
        while let Some(j) = at {
            height += f64::from(rig.joints[j].offset[1]);
            at = rig.joints[j].parent;
        }
        let scale = HEAD_HEIGHT / height;
        let place = |frame: &Frame, j: usize| scale * frame.global[j].position.as_dvec3();
        let relative = |j: usize| frames.iter().map(|f| place(f, j) - place(f, 0)).collect::<Vec<_>>();
        let points = [relative(hands[0]), relative(hands[1])];
        let moved = points.each_ref().map(|p| derivatives(&smoothed(p)));
        let hands = (0..frames.len())
            .map(|i| Hands {
                place: [points[0][i], points[1][i]],
                speed: [moved[0][i][0], moved[1][i][0]],
                acceleration: [moved[0][i][1], moved[1][i][1]],
            })
            .collect();
        let yaw = gaussian(&unwrapped(frames.iter().map(|f| f.root.yaw)), 15.0);
        let over = frames.iter().zip(&yaw).map(|(f, yaw)| {
            let d = place(f, 0) - 0.5 * (place(f, feet[0]) + place(f, feet[1]));
            let (s, c) = yaw.sin_cos();
            DVec2::new(c * d.x - s * d.z, s * d.x + c * d.z)
        });
        Some(Self { hands, head: derivatives(&smoothed(&relative(head))), over: over.collect() })
    }
}

/// Hann-smoothed over nine frames, the ends held.
fn smoothed(points: &[DVec3]) -> Vec<DVec3> {
    let weight = |k: usize| 0.5 - 0.5 * (std::f64::consts::TAU * (k + 1) as f64 / 10.0).cos();
    let total: f64 = (0..9).map(weight).sum();
    let last = points.len().saturating_sub(1);
    let at = |i: usize| (0..9).map(|k| points[(i + k).saturating_sub(4).min(last)] * (weight(k) / total)).sum();
    (0..points.len()).map(at).collect()
}

/// Speed and acceleration at each point; nothing at the ends.
fn derivatives(points: &[DVec3]) -> Vec<[f64; 2]> {
    let mut out = vec![[0.0; 2]; points.len()];
    for (i, pair) in points.windows(2).enumerate() {
        out[i + 1][0] = pair[0].distance(pair[1]) * RATE;
    }
    for (i, three) in points.windows(3).enumerate() {
        out[i + 1][1] = (three[2] - 2.0 * three[1] + three[0]).length() * RATE * RATE;
    }
    out
}

fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::new();
    for angle in angles {
        let last = out.last().copied().unwrap_or(angle);
        let step = (angle - last + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        out.push(last + step);
    }
    out
}

/// Gaussian smoothing with the ends held, the kernel cut at four standard deviations.
pub(super) fn gaussian(values: &[f64], sigma: f64) -> Vec<f64> {
    let reach = (4.0 * sigma).ceil() as usize;
    let kernel: Vec<f64> =
        (0..=2 * reach).map(|k| (-0.5 * ((k as f64 - reach as f64) / sigma).powi(2)).exp()).collect();
    let total: f64 = kernel.iter().sum();
    let last = values.len().saturating_sub(1);
    let at = |i: usize| {
        let weighted = kernel.iter().enumerate().map(|(k, w)| w * values[(i + k).saturating_sub(reach).min(last)]);
        weighted.sum::<f64>() / total
    };
    (0..values.len()).map(at).collect()
}

/// Stretches of frames under a mask: first frame, and the one after the last.
pub(super) fn runs(mask: &[bool]) -> impl Iterator<Item = (usize, usize)> {
    let begins = |&i: &usize| mask[i] && (i == 0 || !mask[i - 1]);
    (0..mask.len()).filter(begins).map(|from| (from, from + mask[from..].iter().take_while(|&&m| m).count()))
}

fn deviation(values: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
    let n = values.len() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / n).sqrt()
}

/// One-sided power spectral density of [`SPECTRUM`] values, Hann window, mean taken out.
fn power(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n as f64;
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / n as f64;
    let window: Vec<f64> = (0..n).map(|i| 0.5 - 0.5 * turn(i).cos()).collect();
    let norm = 2.0 / (RATE * window.iter().map(|w| w * w).sum::<f64>());
    let highest = (BANDS[BANDS.len() - 1] / RATE * n as f64).ceil() as usize;
    let bin = |f: usize| {
        let terms = values.iter().zip(&window).enumerate().map(|(i, (v, w))| {
            let (s, c) = turn(f * i % n).sin_cos();
            DVec2::new(c, s) * ((v - mean) * w)
        });
        terms.sum::<DVec2>().length_squared() * norm
    };
    (0..=highest).map(bin).collect()
}

/// Root of the mean power in each of [`BANDS`]; nothing of nothing.
fn bands(spectra: &[Vec<f64>]) -> Vec<f64> {
    if spectra.is_empty() {
        return Vec::new();
    }
    let step = RATE / SPECTRUM as f64;
    let mean = |f: usize| spectra.iter().map(|s| s[f]).sum::<f64>() / spectra.len() as f64;
    let band = |edges: &[f64]| {
        let inside = |f: &usize| (edges[0]..edges[1]).contains(&(*f as f64 * step));
        ((0..spectra[0].len()).filter(inside).map(mean).sum::<f64>() * step).sqrt()
    };
    BANDS.windows(2).map(band).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    fn row(n: usize, change: impl Fn(usize, f32, &mut [glam::Vec3])) -> Liveliness {
        let r = recording(n, change);
        let mut tally = Tally::default();
        tally.add(&r.rig, &r.frames, &vec![true; n]);
        tally.row()
    }

    /// The head of the testing rig is at 1.5 m: what moves at v there is measured as 1.6 / 1.5 v.
    const SCALE: f32 = 1.6 / 1.5;

    #[test]
    fn stillness_and_speed_are_what_was_put_in() {
        let hands = |speed: f32| {
            row(900, move |i, _, p| {
                let way = (i.clamp(300, 600) - 300) as f32 / 30.0 * speed / SCALE;
                p[2].y += way;
                p[3].y += way;
            })
        };
        let fast = hands(0.06);
        close(fast.stillness.unwrap(), 2.0 / 3.0, 0.01);
        close(fast.hand_speed.unwrap(), 0.02, 5e-4);
        assert_eq!((fast.head_speed, fast.sway), (Some(0.0), Some(0.0)));
        close(fast.still_stretches.unwrap(), 4.0, 0.05);
        assert!(fast.rest_changes.unwrap() > 0.0);
        let third = Some(1.0 / 3.0);
        assert_eq!((fast.still_never, fast.still_throughout), (third, Some(2.0 / 3.0)), "ten of thirty seconds");
        let slow = hands(0.02);
        assert_eq!((slow.stillness, slow.rest_changes), (Some(1.0), Some(0.0)));
    }

    #[test]
    fn sway_and_spectrum_of_a_sine() {
        let swaying = row(1800, |_, t, p| {
            let x = 0.05 / SCALE * (std::f32::consts::TAU * 0.2 * t).sin();
            p[..4].iter_mut().for_each(|p| p.x += x);
        });
        close(swaying.sway.unwrap(), 5.0 / 2_f64.sqrt(), 0.1);
        assert_eq!(swaying.stillness, Some(1.0), "hands that go with the hips are still");
        // A hand that swings at 0.75 Hz is fast twice in each swing.
        let waving = row(1800, |_, t, p| {
            let y = 0.02 * (std::f32::consts::TAU * 0.75 * t).sin();
            p[2].y += y;
            p[3].y += y;
        });
        let spectrum = &waving.hand_spectrum;
        assert_eq!(spectrum.len(), BANDS.len() - 1);
        assert!(spectrum[2] > 5.0 * spectrum[0].max(spectrum[4]), "{spectrum:?}");
    }

    #[test]
    fn a_mask_chooses_and_tallies_add_up() {
        let r = recording(600, |i, t, p| p[2].y += if i < 300 { 0.0 } else { 0.2 * t });
        let of = |part: std::ops::Range<usize>| {
            let mut tally = Tally::default();
            let mask: Vec<_> = (0..600).map(|i| part.contains(&i)).collect();
            tally.add(&r.rig, &r.frames, &mask);
            tally
        };
        assert_eq!(of(0..290).row().stillness, Some(1.0));
        assert_eq!(of(310..600).row().stillness, Some(0.0));
        let mut both = of(0..300);
        both.merge(of(300..600));
        let (both, whole) = (both.row(), of(0..600).row());
        assert_eq!((both.seconds, both.stillness), (whole.seconds, whole.stillness));
        assert_eq!((both.still_throughout, both.still_never), (Some(0.5), Some(0.5)));
        assert_eq!(of(0..0).row(), Liveliness::default());
    }
}
