//! Summaries of many numbers.

use serde::{Deserialize, Serialize};

/// Mean, median, 99th percentile (nearest rank) and largest of a set of values.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Spread {
    /// Arithmetic mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// Of `values`, each multiplied by `scale`; zeros of nothing.
    pub fn of<'a>(values: impl IntoIterator<Item = &'a f32>, scale: f64) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().map(|&v| scale * f64::from(v)).collect();
        if sorted.is_empty() {
            return Self::default();
        }
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let rank = |p: f64| sorted[((p * n as f64).ceil() as usize).clamp(1, n) - 1];
        Self { mean: sorted.iter().sum::<f64>() / n as f64, p50: rank(0.5), p99: rank(0.99), max: sorted[n - 1] }
    }
}

/// 10 log10 of signal over noise power in dB, `None` where they are equal or not a number.
pub fn sqnr(reference: &[f32], other: &[f32]) -> Option<f64> {
    Some(visavis::internals::quant::sqnr_db(reference, other)).filter(|db| db.is_finite())
}

/// Cosine of the angle between two vectors; 1 for two zero vectors.
pub fn cosine(a: &[f32], b: &[f32]) -> f64 {
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum::<f64>();
    let norm = (dot(a, a) * dot(b, b)).sqrt();
    if norm == 0.0 { 1.0 } else { dot(a, b) / norm }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_ranks() {
        let values: Vec<f32> = (1..=200).map(|v| v as f32).collect();
        assert_eq!(Spread::of(&values, 2.0), Spread { mean: 201.0, p50: 200.0, p99: 396.0, max: 400.0 });
        assert_eq!(Spread::of(&[], 1.0), Spread::default());
    }

    #[test]
    fn similarity() {
        assert!((cosine(&[1.0, 0.0], &[1.0, 1.0]) - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!((cosine(&[0.0], &[0.0]), sqnr(&[1.0, 2.0], &[1.0, 2.0])), (1.0, None));
        assert!((sqnr(&[10.0], &[9.0]).unwrap() - 20.0).abs() < 1e-6);
    }
}
