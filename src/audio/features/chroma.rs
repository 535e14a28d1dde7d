//! Chroma: how much of each pitch class is in a frame, by the constant-Q and by the Fourier
//! transform.

use super::spectra::{N_FFT, filtered, hann, powers};
use super::{CHROMA, unit_peak};
use crate::audio::fft::{Complex, Fft};
use crate::frame::SAMPLE_RATE;
use std::f64::consts::TAU;

/// Samples of a frame's spectrum for the constant-Q transform.
const CQ_FFT: usize = 8192;
/// Tones of the constant-Q transform, six octaves from C2.
const CQ_BINS: usize = 72;

/// Chroma `[T, 12]` of the constant-Q transform of samples `y`, peak 1 in each frame.
pub(super) fn constant_q(y: &[f64]) -> Vec<f64> {
    let mut magnitudes = powers(y, CQ_FFT);
    magnitudes.iter_mut().for_each(|v| *v = v.sqrt());
    unit_peak(filtered(&magnitudes, CQ_FFT / 2 + 1, &constant_q_filters()), CHROMA)
}

/// Chroma `[T, 12]` of the powers of [`N_FFT`] samples' spectra, peak 1 in each frame.
pub(super) fn fourier(power: &[f64]) -> Vec<f64> {
    unit_peak(filtered(power, N_FFT / 2 + 1, &chroma_filters()), CHROMA)
}

/// `[12, 4097]`: magnitudes of 72 windowed complex tones' spectra, those of a pitch class added up;
/// first row C.
fn constant_q_filters() -> Vec<f64> {
    let rate = f64::from(SAMPLE_RATE);
    let ratio = libm::pow(2.0, 2.0 / 12.0);
    let q = (ratio + 1.0) / (ratio - 1.0);
    let low = 440.0 * libm::pow(2.0, -33.0 / 12.0);
    let columns = CQ_FFT / 2 + 1;
    let (fft, mut out) = (Fft::new(CQ_FFT), vec![0.0; CHROMA * columns]);
    let mut tone = vec![Complex::default(); CQ_FFT];
    for k in 0..CQ_BINS {
        let f = low * libm::pow(2.0, k as f64 / 12.0);
        let length = q * rate / f;
        let (first, end) = ((-length / 2.0).floor(), (length / 2.0).floor());
        let window = hann((end - first) as usize);
        let scale = length / CQ_FFT as f64 / window.iter().sum::<f64>();
        tone.fill(Complex::default());
        for (i, (tone, w)) in tone.iter_mut().zip(&window).enumerate() {
            let turn = Complex::turn(TAU * (first + i as f64) * f / rate);
            *tone = Complex::new(w * scale * turn.re, w * scale * turn.im);
        }
        fft.forward(&mut tone);
        for (sum, v) in out[k % CHROMA * columns..][..columns].iter_mut().zip(&tone) {
            *sum += v.power().sqrt();
        }
    }
    let scale = (CQ_FFT as f64).sqrt();
    out.iter_mut().for_each(|v| *v /= scale);
    out
}

/// `[12, 1025]`: Gaussians about each pitch class, of unit length in every bin, weighed about the
/// fifth octave of A; first row C.
fn chroma_filters() -> Vec<f64> {
    let pitch = |k: usize| {
        let f = k as f64 * f64::from(SAMPLE_RATE) / N_FFT as f64;
        12.0 * libm::log2(f / (440.0 / 16.0))
    };
    let columns = N_FFT / 2 + 1;
    let mut out = vec![0.0; CHROMA * columns];
    for k in 0..columns {
        // The bin of no frequency counts as one and a half octaves below the first.
        let here = if k == 0 { pitch(1) - 18.0 } else { pitch(k) };
        let width = (pitch(k + 1) - here).max(1.0);
        let mut column = [0.0; CHROMA];
        for (c, w) in column.iter_mut().enumerate() {
            let off = (here - c as f64 + 126.0).rem_euclid(12.0) - 6.0;
            let wide = 2.0 * off / width;
            *w = libm::exp(-0.5 * wide * wide);
        }
        let norm = column.iter().map(|w| w * w).sum::<f64>().sqrt();
        let octave = (here / 12.0 - 5.0) / 2.0;
        let weight = libm::exp(-0.5 * octave * octave) / norm;
        for (c, w) in column.iter().enumerate() {
            // Bins count from A.
            out[(c + CHROMA - 3) % CHROMA * columns + k] = w * weight;
        }
    }
    out
}
