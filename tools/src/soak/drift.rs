//! Drift of a metric over the cycles of a soak, told from the spread between cycles.
//!
//! Ten minutes of bursty motion are few: the mean joint speed of neighbouring cycles differs by 15
//! %, the share of sliding feet by 20 %, with no trend. So halves of the run are compared, not
//! single cycles, and a difference counts as drift for so much of it as chance does not explain:
//! all but two standard errors, which come from the spread of the cycles *within* the halves and so
//! do not grow with the drift itself. The longer the soak, the less there is to excuse.

use crate::metrics::mean_and_error2;

/// Standard errors of a difference that chance explains: one in twenty is larger.
const ERRORS: f64 = 2.0;
/// Cycles of each half at least.
const CYCLES: usize = 2;

/// Means of a metric over the first and the last half of a run's cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Drift {
    pub(super) first: f64,
    pub(super) last: f64,
    /// Standard error of their difference.
    pub(super) error: f64,
}

impl Drift {
    /// Of the values of the cycles in order; `None` where they are too few. A middle cycle belongs
    /// to no half.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let half = values.len() / 2;
        if half < CYCLES {
            return None;
        }
        let (first, first_error) = mean_and_error2(&values[..half]);
        let (last, last_error) = mean_and_error2(&values[values.len() - half..]);
        Some(Self { first, last, error: libm::sqrt(first_error + last_error) })
    }

    /// The difference, as a share of `scale`, less what chance explains; 0 where it explains all.
    pub(super) fn beyond_chance(&self, scale: f64) -> f64 {
        ((self.last - self.first).abs() - ERRORS * self.error).max(0.0) / scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_is_no_drift_and_drift_is_no_spread() {
        let drift = |values: &[f64]| Drift::of(values).map(|d| d.beyond_chance(d.first));
        assert_eq!(drift(&[1.0, 1.0, 1.0]), None, "too few");
        assert_eq!(drift(&[0.8, 1.2, 1.0, 1.3, 0.9, 1.1]), Some(0.0), "up and down");
        // Without spread nothing is excused.
        assert!((drift(&[1.0, 1.0, 1.0, 1.2, 1.2, 1.2]).unwrap() - 0.2).abs() < 1e-12);
        assert!(drift(&[0.9, 1.1, 1.0, 1.9, 2.1, 2.0]).unwrap() > 0.8);
        // An even rise by 60 % counts as spread in few cycles, not in many.
        let rising = |n: usize, by: f64| -> Vec<f64> {
            (0..n).map(|i| 1.0 + by * i as f64 / n as f64 + if i % 2 == 0 { 0.1 } else { -0.1 }).collect()
        };
        assert!(drift(&rising(6, 0.6)).unwrap() < 0.15 && drift(&rising(60, 0.6)).unwrap() > 0.15);
        // A middle cycle does not count.
        let odd = Drift::of(&[1.0, 1.0, 9.0, 2.0, 2.0]).unwrap();
        assert_eq!((odd.first, odd.last, odd.error), (1.0, 2.0, 0.0));
    }
}
