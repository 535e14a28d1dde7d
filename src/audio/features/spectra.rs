//! Frames of sound, their spectra, and what is read from the loudness of bands: decibels of mel
//! bands, cepstral coefficients, slopes.

use super::{HOP, MFCC};
use crate::audio::fft::{Complex, Fft};
use crate::frame::SAMPLE_RATE;
use std::f64::consts::{PI, TAU};

/// Samples of a frame's spectrum.
pub(super) const N_FFT: usize = 2048;
/// Mel bands.
const MELS: usize = 128;
/// Frames of a slope.
pub(super) const SLOPE: usize = 9;

/// Sample `at` of `y`, zeros beyond its ends.
fn sample(y: &[f64], at: isize) -> f64 {
    usize::try_from(at).ok().and_then(|at| y.get(at)).copied().unwrap_or(0.0)
}

/// The `n` samples about every 800th of `y`, frame by frame.
pub(super) fn frames(y: &[f64], n: usize) -> impl Iterator<Item = impl Iterator<Item = f64> + '_> + '_ {
    (0..y.len() / HOP).map(move |t| {
        let first = (t * HOP) as isize - (n / 2) as isize;
        (0..n as isize).map(move |i| sample(y, first + i))
    })
}

/// The periodic Hann window.
pub(super) fn hann(n: usize) -> Vec<f64> {
    (0..n).map(|i| 0.5 - 0.5 * libm::cos(TAU * i as f64 / n as f64)).collect()
}

/// Powers `[T, n / 2 + 1]` of the Hann-windowed frames.
pub(super) fn powers(y: &[f64], n: usize) -> Vec<f64> {
    let (fft, window) = (Fft::new(n), hann(n));
    let mut out = Vec::with_capacity((y.len() / HOP) * (n / 2 + 1));
    let mut x = vec![Complex::default(); n];
    for frame in frames(y, n) {
        for ((x, v), w) in x.iter_mut().zip(frame).zip(&window) {
            *x = Complex::new(v * w, 0.0);
        }
        fft.forward(&mut x);
        out.extend(x[..=n / 2].iter().map(|v| v.power()));
    }
    out
}

/// Each row of `x` (`columns` values) times each row of `filters`: `[rows, filters]`.
pub(super) fn filtered(x: &[f64], columns: usize, filters: &[f64]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    x.chunks_exact(columns).flat_map(|row| filters.chunks_exact(columns).map(move |f| dot(row, f))).collect()
}

/// Slaney's triangles `[128, 1025]` from 0 to 12 kHz, each of unit area.
fn mel_filters() -> Vec<f64> {
    const KNEE: f64 = 1000.0;
    let step = libm::log(6.4) / 27.0;
    let top = 15.0 + libm::log(f64::from(SAMPLE_RATE) / 2.0 / KNEE) / step;
    let edge = |i: usize| {
        let mel = top * i as f64 / (MELS + 1) as f64;
        if mel < 15.0 { mel * 200.0 / 3.0 } else { KNEE * libm::exp(step * (mel - 15.0)) }
    };
    let edges: Vec<f64> = (0..MELS + 2).map(edge).collect();
    let mut out = Vec::with_capacity(MELS * (N_FFT / 2 + 1));
    for e in edges.windows(3) {
        for k in 0..=N_FFT / 2 {
            let f = k as f64 * f64::from(SAMPLE_RATE) / N_FFT as f64;
            let (up, down) = ((f - e[0]) / (e[1] - e[0]), (e[2] - f) / (e[2] - e[1]));
            out.push(up.min(down).max(0.0) * 2.0 / (e[2] - e[0]));
        }
    }
    out
}

/// Loudness `[T, 128]` of the mel bands, `10 log10` of at least 1e-10, at most 80 dB below the
/// loudest of the clip.
pub(super) fn decibels(power: &[f64]) -> Vec<f64> {
    let mut db = filtered(power, N_FFT / 2 + 1, &mel_filters());
    db.iter_mut().for_each(|v| *v = 10.0 * libm::log10(v.max(1e-10)));
    let floor = db.iter().copied().fold(f64::NEG_INFINITY, f64::max) - 80.0;
    db.iter_mut().for_each(|v| *v = v.max(floor));
    db
}

/// The first 20 coefficients `[T, 20]` of the orthonormal DCT-II over the bands.
pub(super) fn cosines(db: &[f64]) -> Vec<f64> {
    let mut basis = Vec::with_capacity(MFCC * MELS);
    for k in 0..MFCC {
        let scale = (if k == 0 { 1.0 } else { 2.0 } / MELS as f64).sqrt();
        basis.extend((0..MELS).map(|n| scale * libm::cos(PI * k as f64 * (n as f64 + 0.5) / MELS as f64)));
    }
    filtered(db, MELS, &basis)
}

/// Slope `[T, 20]` of the line through nine frames; the first and last four share that of the
/// first and last nine.
pub(super) fn slopes(x: &[f64]) -> Vec<f64> {
    let frames = x.len() / MFCC;
    let reach = SLOPE / 2;
    let mut out = Vec::with_capacity(x.len());
    for t in 0..frames {
        let first = t.clamp(reach, frames - 1 - reach) - reach;
        for c in 0..MFCC {
            let term = |k: usize| (k as f64 - reach as f64) / 60.0 * x[(first + k) * MFCC + c];
            out.push((0..SLOPE).map(term).sum());
        }
    }
    out
}

/// Mean rise of the bands `[T]` since the frame before, two frames late.
pub(super) fn onsets(db: &[f64]) -> Vec<f64> {
    let rows: Vec<_> = db.chunks_exact(MELS).collect();
    let rise = |pair: &[&[f64]]| pair[1].iter().zip(pair[0]).map(|(b, a)| (b - a).max(0.0)).sum::<f64>() / MELS as f64;
    [0.0; 2].into_iter().chain(rows.windows(2).map(rise)).take(rows.len()).collect()
}

/// RMS `[T]` of the frames.
pub(super) fn loudness(y: &[f64]) -> Vec<f64> {
    frames(y, N_FFT).map(|frame| (frame.map(|v| v * v).sum::<f64>() / N_FFT as f64).sqrt()).collect()
}
