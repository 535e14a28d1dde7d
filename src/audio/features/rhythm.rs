//! Rhythm: how an onset envelope repeats, and where its beats are.

use super::spectra::hann;
use super::unit_peak;
use crate::frame::FPS;

/// Frames over which the tempo is looked for, and lags at which: 8 s.
const TEMPO_LAGS: usize = 8 * FPS as usize;
/// Shortest period of a beat, frames: 300 a minute.
const SHORTEST: usize = 6;
/// How much a beat that is off the period costs.
const TIGHTNESS: f64 = 100.0;

/// Autocorrelation `[T, lags]` of the Hann-windowed envelope around each frame, peak 1; beyond its
/// ends the envelope falls to zero in straight lines.
pub(super) fn tempogram(envelope: &[f64], lags: usize) -> Vec<f64> {
    let (half, window) = (lags / 2, hann(lags));
    let ramp = |edge: Option<&f64>, i: usize| edge.copied().unwrap_or(0.0) * i as f64 / half as f64;
    let before = (0..half).map(|i| ramp(envelope.first(), i));
    let after = (0..half).rev().map(|i| ramp(envelope.last(), i));
    let padded: Vec<f64> = before.chain(envelope.iter().copied()).chain(after).collect();
    let mut out = Vec::with_capacity(envelope.len() * lags);
    for stretch in padded.windows(lags).take(envelope.len()) {
        let row: Vec<f64> = stretch.iter().zip(&window).map(|(v, w)| v * w).collect();
        out.extend((0..lags).map(|lag| row[lag..].iter().zip(&row).map(|(a, b)| a * b).sum::<f64>()));
    }
    unit_peak(out, lags)
}

/// Frames of a beat: the lag at which the mean tempogram of 8 s is strongest, with a log-normal
/// preference for 120 a minute.
fn period(envelope: &[f64]) -> usize {
    let rows = tempogram(envelope, TEMPO_LAGS);
    let mean = |lag: usize| rows.iter().skip(lag).step_by(TEMPO_LAGS).sum::<f64>() / envelope.len() as f64;
    let strength = |lag: usize| {
        let octaves = libm::log2(60.0 * f64::from(FPS) / lag as f64 / 120.0);
        libm::log1p(1e6 * mean(lag)) - 0.5 * octaves * octaves
    };
    first_largest((SHORTEST..TEMPO_LAGS).map(strength)).map_or(SHORTEST, |(i, _)| SHORTEST + i)
}

/// The first of the largest values, and its place.
fn first_largest(values: impl Iterator<Item = f64>) -> Option<(usize, f64)> {
    values.enumerate().reduce(|best, next| if next.1 > best.1 { next } else { best })
}

/// How well a beat of every `every` frames fits at each frame: the envelope, in standard
/// deviations, smoothed by a Gaussian of 1/32 of a beat.
fn fits(envelope: &[f64], every: usize) -> Vec<f64> {
    let n = envelope.len();
    let mean = envelope.iter().sum::<f64>() / n as f64;
    let squares = envelope.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
    let deviation = (squares / (n as f64 - 1.0)).sqrt() + f64::MIN_POSITIVE;
    let window = |k: usize| {
        let x = (k as f64 - every as f64) * 32.0 / every as f64;
        libm::exp(-0.5 * x * x)
    };
    let window: Vec<f64> = (0..=2 * every).map(window).collect();
    // The sum of same length that is the reference's leaves out the first frame at full reach.
    let range = |i: usize| (i + every + 1).saturating_sub(n)..(i + every).min(2 * every + 1);
    let sum = |i: usize| range(i).map(|k| window[k] * (envelope[i + every - k] / deviation)).sum();
    (0..n).map(sum).collect()
}

/// Beats `[T]`, 0 or 1, by dynamic programming (Ellis 2007), those of weak onsets at both ends left
/// out.
pub(super) fn beats(envelope: &[f64]) -> Vec<f64> {
    let n = envelope.len();
    let mut out = vec![0.0; n];
    if envelope.iter().all(|v| *v == 0.0) {
        return out;
    }
    let every = period(envelope);
    let score = fits(envelope, every);
    let (total, before) = chains(&score, every);
    let peak = |i: usize| i > 0 && total[i] > total[i - 1] && (i + 1 == n || total[i] >= total[i + 1]);
    let mut peaks: Vec<f64> = (0..n).filter(|i| peak(*i)).map(|i| total[i]).collect();
    peaks.sort_by(f64::total_cmp);
    let middle = peaks.len() / 2;
    let median = match peaks.len() {
        0 => 0.0,
        odd if odd % 2 == 1 => peaks[middle],
        _ => 0.5 * (peaks[middle - 1] + peaks[middle]),
    };
    let mut at = (0..n).rev().find(|i| peak(*i) && total[*i] >= 0.5 * median).or(n.checked_sub(1));
    while let Some(i) = at {
        out[i] = 1.0;
        at = before[i];
    }
    trim(&score, &mut out);
    out
}

/// The best sum of a chain of beats that ends at each frame, and the beat before that.
fn chains(score: &[f64], every: usize) -> (Vec<f64>, Vec<Option<usize>>) {
    let n = score.len();
    let nearest = (every as f64 / 2.0).round_ties_even() as usize;
    let least = 0.01 * score.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (mut total, mut before, mut first) = (vec![0.0; n], vec![None; n], true);
    for i in 0..n {
        let places = (i.saturating_sub(2 * every)..(i + 1).saturating_sub(nearest)).rev();
        let cost = |place: usize| {
            let off = libm::log((i - place) as f64) - libm::log(every as f64);
            TIGHTNESS * off * off
        };
        let best = first_largest(places.clone().map(|place| total[place] - cost(place)));
        total[i] = score[i] + best.map_or(0.0, |(_, sum)| sum);
        if !first || score[i] >= least {
            before[i] = best.and_then(|(k, _)| places.clone().nth(k));
            first = false;
        }
    }
    (total, before)
}

/// Takes away beats before the first and after the last frame that fits well.
fn trim(score: &[f64], beats: &mut [f64]) {
    const HANNING: [f64; 5] = [0.0, 0.5, 1.0, 0.5, 0.0];
    let at: Vec<f64> = score.iter().zip(&*beats).filter(|(_, beat)| **beat > 0.0).map(|(s, _)| *s).collect();
    let smooth = |i: usize| {
        let term = |(k, w): (usize, &f64)| i.checked_sub(k).and_then(|i| at.get(i)).map_or(0.0, |s| s * w);
        HANNING.iter().enumerate().map(term).sum::<f64>()
    };
    let range = 2..(at.len() + 4).min(score.len() + 2);
    let count = range.len() as f64;
    let least = 0.5 * (range.map(|i| smooth(i) * smooth(i)).sum::<f64>() / count).sqrt();
    let strong = |s: &f64| *s > least;
    if let (Some(first), Some(last)) = (score.iter().position(strong), score.iter().rposition(strong)) {
        beats[..first].fill(0.0);
        beats[last + 1..].fill(0.0);
    }
}
