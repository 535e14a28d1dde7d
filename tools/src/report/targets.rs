//! What each scheme is held to.

use super::numerics::CandidateNumerics;
use serde::Serialize;
use visavis::internals::kernels::Scheme;

/// A figure against its target.
#[derive(Debug, Clone, Serialize)]
pub struct Target {
    /// What is measured.
    pub what: String,
    /// Largest value that is good.
    pub target: f64,
    /// What was measured; none where it could not be.
    pub measured: Option<f64>,
}

impl Target {
    /// `met`, `missed` or `not measured`.
    pub fn verdict(&self) -> &'static str {
        match self.measured {
            Some(v) if v <= self.target => "met",
            Some(_) => "missed",
            None => "not measured",
        }
    }
}

/// Mean and 99th percentile of the joint error (mm), gaze error, FGD change, size against f32.
fn limits(scheme: Scheme) -> Option<[f64; 5]> {
    match scheme {
        Scheme::F16 => Some([0.1, 0.5, 0.0005, 0.005, 0.5]),
        Scheme::I8 => Some([1.0, 5.0, 0.003, 0.02, 0.27]),
        Scheme::I4 => Some([4.0, 20.0, 0.01, 0.05, 0.16]),
        Scheme::F32 => None,
    }
}

/// The targets of a bundle of `scheme`: of its samplers, the worse counts.
pub(super) fn targets(scheme: Scheme, numerics: &CandidateNumerics, size: f64, fgd_change: Option<f64>) -> Vec<Target> {
    let Some(limits) = limits(scheme) else { return Vec::new() };
    let worst = |of: fn(&super::Blocks) -> f64| numerics.blocks.iter().map(of).reduce(f64::max);
    let measured = [
        ("mean joint error, mm", worst(|b| b.mm.mean)),
        ("99th percentile of the joint error, mm", worst(|b| b.mm.p99)),
        ("mean gaze error", worst(|b| b.gaze.mean)),
        ("change of FGD", fgd_change),
        ("size against f32", Some(size)),
    ];
    let target =
        |((what, measured), target): ((&str, Option<f64>), f64)| Target { what: what.to_owned(), target, measured };
    measured.into_iter().zip(limits).map(target).collect()
}
