//! Do the hands move with the voice?

use super::speech::envelope;
use super::{RATE, mean, wrist_speeds};
use crate::recording::Recording;
use serde::Serialize;

/// Largest lag that is tried, seconds.
const MAX_LAG: f64 = 0.3;
/// Shuffles that the reference value is averaged over.
const SHUFFLES: u64 = 32;
/// Shuffling moves pieces of this length, frames: short enough to lose the sentence, long enough to
/// keep syllables whole.
const PIECE: usize = 30;

/// How wrist speed follows the agent's voice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Beat {
    /// Pearson correlation of speech envelope and wrist speed at the best lag, -1 to 1.
    pub correlation: f64,
    /// Lag of the wrists behind the voice at that correlation, seconds; negative when the hands
    /// lead.
    pub lag: f64,
    /// The same with the voice cut into pieces of a second and shuffled (mean of 32 fixed
    /// shuffles): what chance gives.
    pub shuffled: f64,
}

/// Correlation between the agent's speech envelope (RMS a frame) and wrist speed, best lag within
/// ±0.3 s.
///
/// `None` without an agent voice, without hands, below two seconds, or when voice or wrists never
/// change.
pub fn beat(recording: &Recording) -> Option<Beat> {
    let wrists = wrist_speeds(&recording.rig, &recording.frames)?;
    if wrists.len() < 2 * PIECE {
        return None;
    }
    // wrists[i] is the speed from frame i to i + 1, so it goes with the voice of frame i.
    let levels = envelope(recording.agent_voice.as_deref()?, wrists.len());
    let (correlation, lag) = best_lag(&levels, &wrists)?;
    let chance = (0..SHUFFLES).filter_map(|seed| best_lag(&shuffled(&levels, seed), &wrists)).map(|(c, _)| c);
    Some(Beat { correlation, lag: lag as f64 / RATE, shuffled: mean(chance)? })
}

/// Highest correlation of `b`, delayed by some lag (frames), with `a`.
fn best_lag(a: &[f64], b: &[f64]) -> Option<(f64, i64)> {
    let reach = (MAX_LAG * RATE).round() as i64;
    let at = |lag: i64| {
        let n = a.len() - lag.unsigned_abs() as usize;
        let (from_a, from_b) = ((-lag).max(0) as usize, lag.max(0) as usize);
        Some((pearson(&a[from_a..from_a + n], &b[from_b..from_b + n])?, lag))
    };
    (-reach..=reach).filter_map(at).max_by(|x, y| x.0.total_cmp(&y.0))
}

fn pearson(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mean_a, mean_b) = (mean(a.iter().copied())?, mean(b.iter().copied())?);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&x, &y) in a.iter().zip(b) {
        ab += (x - mean_a) * (y - mean_b);
        aa += (x - mean_a).powi(2);
        bb += (y - mean_b).powi(2);
    }
    let scale = (aa * bb).sqrt();
    (scale > 1e-12).then(|| ab / scale)
}

/// The pieces of `levels` in a random order that depends on `seed` alone (Fisher-Yates).
fn shuffled(levels: &[f64], seed: u64) -> Vec<f64> {
    let mut pieces: Vec<&[f64]> = levels.chunks(PIECE).collect();
    let mut state = seed;
    for i in (1..pieces.len()).rev() {
        pieces.swap(i, (splitmix(&mut state) % (i as u64 + 1)) as usize);
    }
    pieces.concat()
}

/// SplitMix64 (Steele, Lea and Flood 2014).
fn splitmix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    const FRAMES: usize = 600;

    /// A loudness that repeats nowhere, 0 to 1, one value a frame.
    fn loudness() -> Vec<f64> {
        let mut state = 7;
        (0..FRAMES + 20).map(|_| (splitmix(&mut state) >> 11) as f64 / (1_u64 << 53) as f64).collect()
    }

    /// Left wrist speed is the loudness `lag` frames ago.
    fn conversation(lag: usize) -> Recording {
        let loud = loudness();
        let steps: Vec<f64> =
            (0..FRAMES).scan(0.0, |x, i| Some(std::mem::replace(x, *x + loud[i + 10 - lag] / 30.0))).collect();
        let mut r = recording(FRAMES, |i, _, p| p[2].x += steps[i] as f32);
        let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let voice = (0..FRAMES * 800).map(|i| sign(i) * loud[i / 800 + 10] as f32);
        r.agent_voice = Some(voice.collect());
        r
    }

    #[test]
    fn hands_that_follow_the_voice() {
        for lag in [0, 3, 9] {
            let beat = beat(&conversation(lag)).unwrap();
            assert!(beat.correlation > 0.99, "{beat:?}");
            close(beat.lag, lag as f64 / 30.0, 1e-9);
            assert!(beat.shuffled < 0.3, "{beat:?}");
        }
    }

    #[test]
    fn hands_that_do_not() {
        // Ten frames late is beyond the lags that are tried.
        let beat = beat(&conversation(10)).unwrap();
        assert!(beat.correlation < 0.3, "{beat:?}");
    }

    #[test]
    fn nothing_to_measure_is_none() {
        let mut r = conversation(0);
        r.agent_voice = Some(vec![0.0; 24_000]);
        assert_eq!(beat(&r), None);
        r.agent_voice = None;
        assert_eq!(beat(&r), None);
        let mut still = recording(FRAMES, |_, _, _| {});
        still.agent_voice = conversation(0).agent_voice;
        assert_eq!(beat(&still), None);
    }
}
