//! Sounds of the demo, and of the scene that bundles are quantised for and judged by, made by rule:
//! a dog, a crash, a telephone, music.
//!
//! They go through a session, so sines and powers are those of `libm`: the same on every machine.

use crate::offline::Sound;
use glam::DVec3;
use std::f64::consts::TAU;

const RATE: f64 = 24_000.0;
/// What interrupts the sample conversation: where, and when, in its world.
pub fn interruptions() -> Vec<Sound> {
    vec![
        sound("dog", dog(), [2.4, 0.4, 1.2], 3.2),
        // The user is in front of the agent then, which faces +Z.
        sound("crash", crash(), [-0.8, 0.3, -2.4], 8.4),
        // The user has walked to its right, where it looks.
        sound("music", music(), [0.9, 0.9, 1.9], 20.3),
    ]
}

/// What sounds around the agent while the sample conversation goes on, each from elsewhere, with
/// pauses. The first two are within the three seconds that sensitivity is measured on.
pub fn around() -> Vec<Sound> {
    vec![
        sound("crash", crash(), [-1.2, 0.3, -2.2], 0.4),
        sound("telephone", telephone(), [2.1, 0.8, 0.4], 2.5),
        sound("dog", dog(), [-2.4, 0.4, 1.2], 7.1),
        sound("music", music(), [0.9, 0.9, 2.6], 12.0),
        sound("telephone", telephone(), [-2.0, 0.8, -0.5], 21.3),
        sound("crash", crash(), [1.6, 0.3, -1.5], 26.0),
    ]
}

fn sound(name: &str, samples: Vec<f32>, place: [f64; 3], start: f64) -> Sound {
    Sound { name: name.to_owned(), samples, place: DVec3::from_array(place), start, id: None }
}

/// Barks: a throat that opens and closes, its pitch rising and falling. 85 dB SPL.
fn dog() -> Vec<f32> {
    const BARKS: [f64; 5] = [0.0, 0.38, 1.25, 1.6, 1.95];
    const LONG: f64 = 0.19;
    let (mut noise, mut breath) = (Noise(7), 0.0);
    made(2.3, 0.36, |t| {
        let since = BARKS.iter().rev().map(|start| t - start).find(|s| *s >= 0.0).unwrap_or(LONG);
        breath += 0.35 * (noise.next() - breath);
        if since >= LONG {
            return 0.0;
        }
        let part = since / LONG;
        let open = 4.0 * part * (1.0 - part);
        // The integral of 380 Hz that rise by 240 towards the middle.
        let turns = 380.0 * since + 240.0 * LONG * part * part * (2.0 - 4.0 / 3.0 * part);
        open * (wave(turns)
            + 0.7 * wave(2.0 * turns)
            + 0.45 * wave(3.0 * turns)
            + 0.2 * wave(5.0 * turns)
            + 1.2 * breath)
    })
}

/// A shelf that falls: a thud, things that ring and go on rattling. 99 dB SPL.
fn crash() -> Vec<f32> {
    // When each piece lands, and its pitch.
    const PIECES: [(f64, f64); 9] = [
        (0.0, 1730.0),
        (0.03, 2390.0),
        (0.09, 3110.0),
        (0.16, 1270.0),
        (0.27, 2770.0),
        (0.41, 1990.0),
        (0.58, 3530.0),
        (0.83, 2210.0),
        (1.12, 2930.0),
    ];
    let mut noise = Noise(11);
    let mut low = 0.0;
    made(1.8, 1.8, |t| {
        let hiss = noise.next();
        low += 0.06 * (hiss - low);
        let thud = decay(t, 0.09) * (2.0 * wave(62.0 * t) + 5.0 * low);
        let landed = PIECES.iter().filter(|(start, _)| t >= *start).map(|(start, pitch)| {
            let since = t - start;
            decay(since, 0.05) * (wave(pitch * since) + 0.5 * wave(1.51 * pitch * since)) * 0.35
                + decay(since, 0.012) * hiss * 0.8
        });
        thud + landed.sum::<f64>()
    })
}

/// Two rings of a bell that a clapper strikes 22 times a second. 80 dB SPL.
fn telephone() -> Vec<f32> {
    const PARTIALS: [(f64, f64); 4] = [(1040.0, 1.0), (1385.0, 0.8), (2710.0, 0.4), (4330.0, 0.2)];
    const STRIKES: f64 = 22.0;
    const RINGS: [f64; 2] = [0.0, 1.3];
    const LONG: f64 = 0.8;
    made(2.6, 0.2, |t| {
        let since = RINGS.iter().rev().map(|start| t - start).find(|s| *s >= 0.0).unwrap_or(LONG);
        // The last strike of a ring dies away.
        let strike = since.min(LONG - 1.0 / STRIKES);
        let after = since - (strike * STRIKES).floor() / STRIKES;
        let bell = PARTIALS.iter().map(|(pitch, loud)| loud * wave(pitch * since));
        (since * 400.0).min(1.0) * decay(after, 0.06) * bell.sum::<f64>()
    })
}

/// Plucked notes of a pentatonic scale over a slow bass. 75 dB SPL.
fn music() -> Vec<f32> {
    const TUNE: [u32; 16] = [12, 16, 19, 21, 24, 21, 19, 16, 14, 16, 19, 24, 26, 24, 19, 16];
    const BASS: [u32; 4] = [0, 9, 5, 7];
    const STEP: f64 = 0.28;
    const LONG: f64 = 6.72;
    let pitch = |note: u32| 196.0 * libm::exp2(f64::from(note) / 12.0);
    let pluck = |note: u32, since: f64, half: f64| {
        let turns = pitch(note) * since;
        (since * 250.0).min(1.0)
            * decay(since, half)
            * (wave(turns) + 0.3 * wave(2.0 * turns) + 0.12 * wave(3.0 * turns))
    };
    made(LONG, 0.11, |t| {
        let step = (t / STEP) as usize;
        // Each note goes on into the next.
        let melody: f64 =
            (0..3.min(step + 1)).map(|k| pluck(TUNE[(step - k) % 16], t - (step - k) as f64 * STEP, 0.12)).sum();
        let bar = step / 4;
        let bass = pluck(BASS[bar % 4], t - bar as f64 * 4.0 * STEP, 0.5) * 0.5;
        ((LONG - t) / 0.9).min(1.0) * (0.8 * melody + 0.9 * bass)
    })
}

/// `seconds` of a sound whose loudest 50 ms have `level` (RMS, pascals at 1 m).
fn made(seconds: f64, level: f64, mut at: impl FnMut(f64) -> f64) -> Vec<f32> {
    let samples: Vec<f64> = (0..(seconds * RATE) as usize).map(|i| at(i as f64 / RATE)).collect();
    let power = |part: &[f64]| part.iter().map(|x| x * x).sum::<f64>() / part.len() as f64;
    let loudest = samples.chunks(1200).map(power).fold(0.0, f64::max).sqrt();
    samples.iter().map(|x| (x * level / loudest) as f32).collect()
}

/// Falls from 1 by half every `half` seconds.
fn decay(since: f64, half: f64) -> f64 {
    libm::exp2(-since / half)
}

/// Sine of an angle in turns.
fn wave(turns: f64) -> f64 {
    libm::sin(turns.fract() * TAU)
}

/// White noise, -1 to 1.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0) / f64::from(1_u32 << 31) - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sounds_are_finite_loud_as_said_and_end_in_silence() {
        let level = |name: &str| match name {
            "dog" => 0.36_f32,
            "crash" => 1.8,
            "telephone" => 0.2,
            _ => 0.11,
        };
        for sound in interruptions().iter().chain(&around()) {
            let level = level(&sound.name);
            let rms = |part: &[f32]| (part.iter().map(|x| x * x).sum::<f32>() / part.len() as f32).sqrt();
            let loudest = sound.samples.chunks(1200).map(rms).fold(0.0, f32::max);
            assert!((loudest / level - 1.0).abs() < 1e-3, "{}: {loudest}", sound.name);
            let (end, most) = (
                rms(&sound.samples[sound.samples.len() - 240..]),
                sound.samples.iter().fold(0.0_f32, |m, x| m.max(x.abs())),
            );
            assert!(end < 0.05 * level && most < 20.0, "{}: {end} at its end, {most} at most", sound.name);
        }
        for sounds in [interruptions(), around()] {
            assert!(sounds.windows(2).all(|w| w[0].end() < w[1].start));
        }
    }

    /// Wherever the agent looks, something sounds to its left, to its right and behind it.
    #[test]
    fn what_is_around_comes_from_all_sides() {
        let mut bearings: Vec<_> = around().iter().map(|s| s.place.x.atan2(s.place.z)).collect();
        bearings.sort_by(f64::total_cmp);
        let last = bearings[bearings.len() - 1] - TAU;
        let gaps = std::iter::once(last).chain(bearings.iter().copied()).zip(&bearings).map(|(a, b)| b - a);
        assert!(gaps.fold(0.0, f64::max) < TAU / 4.0, "{bearings:?}");
        assert!(around().iter().all(|s| (1.5..3.0).contains(&s.place.x.hypot(s.place.z))));
    }
}
