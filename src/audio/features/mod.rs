//! What an ear hears, [`SIZE`] numbers a frame at 30 frames a second, of a whole clip: the
//! definitions of librosa 0.11 (`training/visavis_train/mospa/features.py` is mirrored here).
//!
//! | columns | |
//! |---|---|
//! | 0..20, 20..40 | MFCC, their deltas |
//! | 40..52, 52..64 | chroma of the constant-Q and of the Fourier transform |
//! | 64 | onset strength |
//! | 65..129 | tempogram, lags of up to 2.1 s |
//! | 129 | beats, 0 or 1 |
//! | 130 | RMS energy |
//! | 131 | active, RMS above 0.01: 0 or 1 |
//!
//! Frame `t` is centred on sample `800 t` at 24 kHz, zeros beyond the ends. All in f64: near
//! silence, normalised features take any noise for signal. The same bits on every CPU.

mod chroma;
mod rhythm;
mod spectra;

use crate::error::{Error, ErrorKind, Result};
use crate::frame::FRAME_SAMPLES;

/// Samples from frame to frame.
const HOP: usize = FRAME_SAMPLES;
const MFCC: usize = 20;
const CHROMA: usize = 12;
const TEMPO: usize = 64;
/// RMS above which a frame is active.
const ACTIVE: f64 = 0.01;

/// Numbers of a frame.
pub const SIZE: usize = 2 * MFCC + 2 * CHROMA + 1 + TEMPO + 3;
/// Least frames of a clip, 0.3 s: a delta is a slope over nine.
pub const LEAST_FRAMES: usize = spectra::SLOPE;

/// Features `[T, 132]` of one ear's samples at 24 kHz, pascals within +-1; T is their number over
/// 800.
///
/// # Errors
/// [`ErrorKind::Audio`] for less than 0.3 s, or samples that are no numbers.
pub fn ear(y: &[f64]) -> Result<Vec<f32>> {
    let frames = y.len() / HOP;
    if frames < LEAST_FRAMES {
        let message = format!("{frames} frames of sound are too few: features need {LEAST_FRAMES}, 0.3 s");
        return Err(Error::new(ErrorKind::Audio, message));
    }
    if let Some(i) = y.iter().position(|v| !v.is_finite()) {
        return Err(Error::new(ErrorKind::Audio, format!("sample {i} of the sound is {}, no number", y[i])));
    }
    let power = spectra::powers(y, spectra::N_FFT);
    let db = spectra::decibels(&power);
    let mfcc = spectra::cosines(&db);
    let envelope = spectra::onsets(&db);
    let rms = spectra::loudness(y);
    let active: Vec<f64> = rms.iter().map(|v| f64::from(u8::from(*v > ACTIVE))).collect();
    let columns = [
        (spectra::slopes(&mfcc), MFCC),
        (chroma::constant_q(y), CHROMA),
        (chroma::fourier(&power), CHROMA),
        (envelope.clone(), 1),
        (rhythm::tempogram(&envelope, TEMPO), TEMPO),
        (rhythm::beats(&envelope), 1),
        (rms, 1),
        (active, 1),
    ];
    let mut out = Vec::with_capacity(frames * SIZE);
    for t in 0..frames {
        out.extend(mfcc[t * MFCC..][..MFCC].iter().map(|v| *v as f32));
        for (values, width) in &columns {
            out.extend(values[t * width..][..*width].iter().map(|v| *v as f32));
        }
    }
    Ok(out)
}

/// Rows divided by their largest magnitude, those of zeros as they are.
fn unit_peak(mut x: Vec<f64>, width: usize) -> Vec<f64> {
    for row in x.chunks_exact_mut(width) {
        let peak = row.iter().fold(0.0, |peak: f64, v| peak.max(v.abs()));
        if peak >= f64::MIN_POSITIVE {
            row.iter_mut().for_each(|v| *v /= peak);
        }
    }
    x
}

#[cfg(test)]
mod tests;
