//! Rounding of weights to a scheme.

use super::argument;
use crate::bundle::{StoredData, StoredWeights};
use crate::error::Result;
use crate::kernels::{I4_GROUP, Scheme};
use half::f16;

/// Rounds `rows` x `cols` weights to `scheme`. Scales are searched for the least squared error:
/// clipping the largest weights a little often leaves the others better off.
///
/// # Errors
/// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) for a weight, or an int4 scale,
/// beyond the range of f16.
///
/// # Panics
/// When there are not `rows * cols` weights.
pub fn round(w: &[f32], rows: usize, cols: usize, scheme: Scheme) -> Result<StoredWeights> {
    assert_eq!(w.len(), rows * cols, "round: rows * cols weights");
    let data = match scheme {
        Scheme::F32 => StoredData::F32(w.to_vec()),
        Scheme::F16 => StoredData::F16(w.iter().map(|&v| half(v)).collect::<Result<_>>()?),
        Scheme::I8 => {
            let (mut q, mut scale) = (Vec::with_capacity(w.len()), Vec::with_capacity(rows));
            for row in w.chunks_exact(cols) {
                let s = int8_scale(row);
                q.extend(row.iter().map(|&v| nearest(v, s, -127.0, 127.0) as i8));
                scale.push(s);
            }
            StoredData::I8 { q, scale }
        }
        Scheme::I4 => {
            let (mut q, mut scale) = (Vec::with_capacity(w.len() / 2), Vec::with_capacity(w.len() / I4_GROUP));
            for row in w.chunks_exact(cols) {
                let mut nibbles = Vec::with_capacity(cols.next_multiple_of(2));
                for group in row.chunks(I4_GROUP) {
                    let s = int4_scale(group)?;
                    nibbles.extend(group.iter().map(|&v| (nearest(v, s.to_f32(), -8.0, 7.0) + 8.0) as u8));
                    scale.push(s);
                }
                // Nobody reads the odd nibble at the end; 8 stands for 0.
                nibbles.resize(cols.next_multiple_of(2), 8);
                q.extend(nibbles.chunks_exact(2).map(|pair| pair[0] | pair[1] << 4));
            }
            StoredData::I4 { q, scale }
        }
    };
    Ok(StoredWeights { rows, cols, data })
}

/// 10 log10 of the power of `reference` over that of the difference, dB; infinite where there is
/// none.
///
/// # Panics
/// When lengths differ.
pub fn sqnr_db(reference: &[f32], other: &[f32]) -> f64 {
    assert_eq!(reference.len(), other.len(), "sqnr: two signals of one length");
    let (signal, noise) = reference.iter().zip(other).fold((0.0f64, 0.0f64), |(s, n), (&a, &b)| {
        let (a, b) = (f64::from(a), f64::from(b));
        (s + a * a, n + (a - b) * (a - b))
    });
    10.0 * (libm::log10(signal) - libm::log10(noise))
}

fn half(v: f32) -> Result<f16> {
    let h = f16::from_f32(v);
    if h.is_finite() {
        return Ok(h);
    }
    Err(argument(format!("a weight is {v}, beyond what f16 holds (65504); keep its layer with --keep LAYER=f32")))
}

/// The integer in `low..=high` nearest to `v / scale`, half to even; 0 for a scale of 0.
pub(super) fn nearest(v: f32, scale: f32, low: f32, high: f32) -> f32 {
    if scale == 0.0 { 0.0 } else { (v / scale).round_ties_even().clamp(low, high) }
}

/// Squared error of a row or group at a scale.
fn error(w: &[f32], scale: f32, low: f32, high: f32) -> f64 {
    w.iter().map(|&v| f64::from(v - scale * nearest(v, scale, low, high)).powi(2)).sum()
}

fn largest(w: &[f32]) -> f32 {
    w.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Below this a row counts as zero: its scale would be denormal.
const TINY: f32 = 1e-30;

/// Scale of a row of int8 weights, among those that clip up to a fifth of the range.
pub(super) fn int8_scale(row: &[f32]) -> f32 {
    let top = largest(row);
    if top < TINY {
        return 0.0;
    }
    let scales = (0..=20).map(|i| top / 127.0 * (1.0 - 0.01 * i as f32));
    best(scales, |&s| error(row, s, -127.0, 127.0)).unwrap_or(top / 127.0)
}

/// Scale of a group of int4 weights. Nibbles reach further down than up, so a negative scale may
/// fit better.
pub(super) fn int4_scale(group: &[f32]) -> Result<f16> {
    let top = largest(group);
    half(top / 7.0)?;
    let scales = (0..=24).flat_map(|i| [top, -top].map(|t| f16::from_f32(t / 8.0 * (1.15 - 0.02 * i as f32))));
    Ok(best(scales, |&s| error(group, s.to_f32(), -8.0, 7.0)).unwrap_or(f16::ZERO))
}

/// The first of the items of least cost.
fn best<T>(items: impl Iterator<Item = T>, cost: impl Fn(&T) -> f64) -> Option<T> {
    let mut least: Option<(f64, T)> = None;
    for item in items {
        let c = cost(&item);
        if least.as_ref().is_none_or(|(l, _)| c < *l) {
            least = Some((c, item));
        }
    }
    least.map(|(_, item)| item)
}
