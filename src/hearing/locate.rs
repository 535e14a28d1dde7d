//! Where what two ears hear comes from.
//!
//! Spectra of short windows give, for each frequency, by which phase and how much louder the left
//! ear hears it. What arrives first counts: a window weighs by how far it is above what the
//! windows before it leave ringing (precedence; Litovsky et al. 1999), and every frequency about
//! alike (phase transform; Knapp and Carter 1976). How well phases and levels are those that the
//! head of `audio/head.rs` makes of a sound from an angle is what a frame says of that angle.
//!
//! That angle is one to the axis of the ears, so a frame cannot tell front from back, nor up from
//! beside. It is laid onto directions of the world as the head is turned in that frame, and what
//! frames say is added up and forgotten: a head that turns tells them apart. Until then the
//! direction before the face is taken for granted.

use super::head::{Head, ears_at};
use crate::audio::fft::{Complex, Fft};
use crate::audio::head::BEND;
use crate::frame::FRAME_SAMPLES;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::OnceLock;

/// Samples of a window, and from one to the next: four in a frame.
const WINDOW: usize = 256;
const STEP: usize = FRAME_SAMPLES / 4;
/// Samples before a frame that its first window begins with.
const BEFORE: usize = WINDOW - STEP;
/// Frequencies that are looked at, multiples of 94 Hz: up to 8.2 kHz.
const LOW: usize = 2;
const BINS: usize = 86;
/// Angles to the plane between the ears, -90 to 90 degrees.
const ANGLES: usize = 37;
/// Azimuths of the world, counterclockwise seen from below: 0 is +Z, a quarter of them +X.
const AZIMUTHS: usize = 72;
/// Heights of directions over the horizon, radians, and how likely they are: what sounds is mostly
/// about as high as a head, or lower. A still head takes what is low for what is more ahead.
const HEIGHTS: [(f64, f64); 3] = [(-0.61, -8.0), (-0.17, 0.0), (0.61, -10.0)];
const DIRECTIONS: usize = AZIMUTHS * HEIGHTS.len();
/// Share of a frequency's power that rings on a window later: 60 dB in 0.7 s.
const RINGING: f64 = 0.85;
/// Exponent of power by which a frequency that is weaker than the window's strongest weighs less.
const EVEN: f64 = 0.15;
/// What a difference of a neper in level says against a direction, in units of the phase, and the
/// largest difference that says more.
const SHADE: f64 = 0.1;
const SHADE_MOST: f64 = 1.5;
/// Log-likelihood of a frequency whose phase is right.
const TRUST: f64 = 0.1;
/// Share of what earlier frames said that is left a frame later.
const KEPT: f64 = 0.97;
/// What is left of it where a louder sound begins.
const KEPT_ANEW: f64 = 0.25;
/// The least that frames may have said of a direction.
const LEAST: f64 = -40.0;
/// By how much the direction behind the head is less likely before anything is heard. Those before
/// the face are alike, so that little evidence does not draw to the middle.
const BEHIND: f64 = 4.0;

/// Finds the direction of what two ears hear. Allocates when made and never after.
pub(super) struct Locator {
    tables: &'static Tables,
    /// Samples of both ears before the next frame, and that frame.
    heard: Box<[[f64; BEFORE + FRAME_SAMPLES]; 2]>,
    spectrum: Box<[Complex; WINDOW]>,
    /// Power that rings on in the next window.
    ringing: [f64; BINS],
    /// What frames said of each direction, the likeliest 0; whether there were any.
    belief: Box<[f64; DIRECTIONS]>,
    knows: bool,
}

/// What does not change, once for all sessions.
struct Tables {
    fft: Fft,
    /// Hann window.
    window: [f64; WINDOW],
    /// Cosine and sine of the phase, and the level in nepers, by which the left ear is before the
    /// right one.
    expected: Vec<[[f64; 3]; ANGLES]>,
    /// Unit vectors.
    directions: Vec<[f64; 3]>,
}

impl Tables {
    fn new() -> Self {
        let rising = |i: usize| 0.5 - 0.5 * libm::cos(TAU * i as f64 / WINDOW as f64);
        let direction = |i: usize| {
            let (sin, cos) = libm::sincos(azimuth(i / HEIGHTS.len()));
            let (up, flat) = libm::sincos(HEIGHTS[i % HEIGHTS.len()].0);
            [sin * flat, up, cos * flat]
        };
        let row = |k: usize| std::array::from_fn(|i| difference(k + LOW, libm::sin(angle(i))));
        Self {
            fft: Fft::new(WINDOW),
            window: std::array::from_fn(rising),
            expected: (0..BINS).map(row).collect(),
            directions: (0..DIRECTIONS).map(direction).collect(),
        }
    }
}

/// What the windows of a frame say of a frequency.
#[derive(Clone, Copy, Default)]
struct Tally {
    /// Weighted sum of the unit vectors of phases.
    phase: [f64; 2],
    /// Sum of weights, and of weighted powers of both ears.
    weight: f64,
    power: [f64; 2],
}

impl Locator {
    pub(super) fn new() -> Self {
        static TABLES: OnceLock<Tables> = OnceLock::new();
        Self {
            tables: TABLES.get_or_init(Tables::new),
            heard: Box::new([[0.0; BEFORE + FRAME_SAMPLES]; 2]),
            spectrum: Box::new([Complex::default(); WINDOW]),
            ringing: [0.0; BINS],
            belief: Box::new([0.0; DIRECTIONS]),
            knows: false,
        }
    }

    /// Nothing is known.
    pub(super) fn forget(&mut self) {
        self.knows = false;
    }

    /// What comes does not follow what was heard before.
    pub(super) fn interrupt(&mut self) {
        self.heard.as_flattened_mut().fill(0.0);
        self.ringing = [0.0; BINS];
    }

    /// Hears a frame of both ears. What it says counts where `told`; with `anew` a louder sound
    /// begins with it.
    pub(super) fn hear(&mut self, ears: [&[f32]; 2], head: &Head, told: bool, anew: bool) {
        for (heard, ear) in self.heard.iter_mut().zip(ears) {
            heard.copy_within(FRAME_SAMPLES.., 0);
            heard[BEFORE..].iter_mut().zip(ear).for_each(|(to, s)| *to = f64::from(*s));
        }
        let mut tallies = [Tally::default(); BINS];
        for first in (0..FRAME_SAMPLES).step_by(STEP) {
            self.look(first, &mut tallies);
        }
        if !told {
            return;
        }
        if !std::mem::replace(&mut self.knows, true) {
            for (i, (belief, direction)) in self.belief.iter_mut().zip(&self.tables.directions).enumerate() {
                let [_, front] = head.sides(*direction);
                *belief = HEIGHTS[i % HEIGHTS.len()].1 + BEHIND * front.min(0.0);
            }
        } else if anew {
            self.belief.iter_mut().for_each(|belief| *belief *= KEPT_ANEW);
        }
        let said = self.compare(&tallies);
        let mut most = f64::NEG_INFINITY;
        for (d, (belief, direction)) in self.belief.iter_mut().zip(&self.tables.directions).enumerate() {
            let [left, _] = head.sides(*direction);
            let at = (libm::asin(left.clamp(-1.0, 1.0)) + FRAC_PI_2) / (PI) * (ANGLES - 1) as f64;
            let i = (at as usize).min(ANGLES - 2);
            let part = at - i as f64;
            let expected = (1.0 - KEPT) * HEIGHTS[d % HEIGHTS.len()].1;
            *belief = KEPT * *belief + expected + said[i] + part * (said[i + 1] - said[i]);
            most = most.max(*belief);
        }
        self.belief.iter_mut().for_each(|belief| *belief = (*belief - most).max(LEAST));
    }

    /// Adds what the window from sample `first` on says.
    fn look(&mut self, first: usize, tallies: &mut [Tally; BINS]) {
        let Self { tables: Tables { fft, window, .. }, heard, spectrum, ringing, .. } = self;
        let [left, right] = heard.each_ref().map(|ear| &ear[first..first + WINDOW]);
        for (to, ((l, r), w)) in spectrum.iter_mut().zip(left.iter().zip(right).zip(window.iter())) {
            *to = Complex::new(l * w, r * w);
        }
        fft.forward(&mut spectrum[..]);
        // Of a transform of left + i right, those of both.
        let ears = |k: usize| {
            let (a, b) = (spectrum[k], spectrum[WINDOW - k].conj());
            let (sum, difference) = (a + b, a - b);
            [Complex::new(0.5 * sum.re, 0.5 * sum.im), Complex::new(0.5 * difference.im, -0.5 * difference.re)]
        };
        let mut both = [[Complex::default(); 2]; BINS];
        both.iter_mut().enumerate().for_each(|(k, both)| *both = ears(k + LOW));
        let power = |[left, right]: &[Complex; 2]| left.power() + right.power();
        let strongest = both.iter().map(power).fold(1e-20, f64::max);
        for ((ears, ringing), tally) in both.iter().zip(ringing).zip(tallies) {
            let power = power(ears);
            let fresh = (power - *ringing).max(0.0);
            *ringing = (RINGING * *ringing).max(power);
            let cross = ears[0] * ears[1].conj();
            let size = cross.power().sqrt();
            if fresh <= 0.0 || size <= 1e-24 {
                continue;
            }
            let weight = fresh / power * libm::exp(EVEN * libm::log(power / strongest));
            tally.weight += weight;
            tally.phase[0] += weight * (cross.re / size);
            tally.phase[1] += weight * (cross.im / size);
            tally.power.iter_mut().zip(ears).for_each(|(sum, ear)| *sum += weight * ear.power());
        }
    }

    /// What a frame says of each angle.
    fn compare(&self, tallies: &[Tally; BINS]) -> [f64; ANGLES] {
        let mut said = [0.0; ANGLES];
        for (tally, expected) in tallies.iter().zip(&self.tables.expected) {
            let Tally { phase, weight, power: [left, right] } = *tally;
            if weight <= 0.0 {
                continue;
            }
            let louder = 0.5 * (libm::log(left + 1e-30) - libm::log(right + 1e-30));
            for (said, [cos, sin, level]) in said.iter_mut().zip(expected) {
                let off = (louder - level).abs().min(SHADE_MOST);
                *said += TRUST * (phase[0] * cos + phase[1] * sin - SHADE * weight * off);
            }
        }
        said
    }

    /// The likeliest azimuth in the world, radians, if anything is known.
    pub(super) fn azimuth(&self) -> Option<f64> {
        if !self.knows {
            return None;
        }
        let mut likely = [0.0; AZIMUTHS];
        for (likely, belief) in likely.iter_mut().zip(self.belief.chunks_exact(HEIGHTS.len())) {
            *likely = belief.iter().map(|belief| libm::exp(*belief)).sum();
        }
        let near = |i: usize, by: usize| likely[(i + AZIMUTHS + by - 3) % AZIMUTHS];
        let smooth = |i: usize| near(i, 3) + 0.5 * (near(i, 2) + near(i, 4));
        let best = (1..AZIMUTHS).fold(0, |best, i| if smooth(i) > smooth(best) { i } else { best });
        let (mut sum, mut moment) = (0.0, 0.0);
        for by in 0..7 {
            sum += near(best, by);
            moment += (by as f64 - 3.0) * near(best, by);
        }
        Some(azimuth(best) + moment / sum * (TAU / AZIMUTHS as f64))
    }
}

/// The angle of a row, radians to the left of the plane between the ears.
fn angle(i: usize) -> f64 {
    (i as f64 / (ANGLES - 1) as f64 - 0.5) * PI
}

/// The azimuth of a column.
fn azimuth(i: usize) -> f64 {
    i as f64 * (TAU / AZIMUTHS as f64)
}

/// Cosine and sine of the phase, and level in nepers, by which the left ear hears bin `k` before
/// the right one, of a sound from where the left ear's axis has an angle of this `cosine`.
fn difference(k: usize, cosine: f64) -> [f64; 3] {
    let omega = TAU * k as f64 / WINDOW as f64;
    let [delay, high] = ears_at(cosine);
    let back = Complex::turn(-omega);
    let ear = |side: usize| {
        let bright = high[side] * BEND;
        let shadow = Complex::new(1.0 + bright + (1.0 - bright) * back.re, (1.0 - bright) * back.im);
        shadow * Complex::turn(-omega * delay[side])
    };
    let (left, right) = (ear(0), ear(1));
    let cross = left * right.conj();
    let size = cross.power().sqrt();
    [cross.re / size, cross.im / size, 0.5 * (libm::log(left.power()) - libm::log(right.power()))]
}
