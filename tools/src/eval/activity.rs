//! What the activity that a model is told at rest does to its body, measured on silent sessions.

use super::EvalProgress;
use super::calibrate::ascending;
use super::people::{self, Idle};
use std::sync::Arc;
use visavis::internals::config::{ACTIVITY, ResponseCurve, RestConfig};
use visavis::internals::session::Diagnostics;
use visavis::{Engine, Result, Sampler, SessionOptions};

/// Shares of stirring, as the network is told them, at which the body is measured.
const STIRRING: [f32; 9] = [-1.0, -0.85, -0.65, -0.4, -0.15, 0.1, 0.4, 0.7, 1.0];
/// Stretches whose stirring differs by so much count for a point by a third.
const NEAR: f32 = 0.15;
/// Sessions of a point, and the seconds of each.
const SESSIONS: (usize, usize) = (8, 40);
/// Times that the curves are shifted.
const SHIFTS: usize = 2;

/// Measures how active a model's body is as a function of what it is told, for both its networks,
/// along the line on which the stretches of real people lie. Bodies also stir because they are told
/// something else: the curves are then shifted until sessions are as active as people on average,
/// half of them before a user and half alone. `with` makes an engine of the model with curves; what
/// `rest` holds of them makes no difference.
///
/// # Errors
/// Those of sessions and of `with`; [`visavis::ErrorKind::Argument`] for a model that does not do
/// what it is told.
pub fn calibrate_rest(
    rest: &RestConfig,
    with: &dyn Fn(&RestConfig) -> Result<Arc<Engine>>,
    threads: usize,
    progress: &(dyn Fn(EvalProgress<'_>) + Sync),
) -> Result<RestConfig> {
    let mut rest = RestConfig { reference: None, student: None, ..rest.clone() };
    let engine = with(&rest)?;
    let curves = |name: &str, sampler: Sampler| -> Result<[ResponseCurve; ACTIVITY]> {
        let mut points = [const { Vec::new() }; ACTIVITY];
        for (i, stirring) in STIRRING.into_iter().enumerate() {
            progress(EvalProgress { stage: &format!("{name}, activity"), done: i + 1, total: STIRRING.len() });
            let told = along(&rest.levels, stirring);
            let diagnostics = Diagnostics { activity: Some(told), ..Default::default() };
            let options = SessionOptions { sampler, diagnostics, ..Default::default() };
            let done = measured(&Idle::of_sessions(&engine, &options, true, threads, SESSIONS)?);
            (0..ACTIVITY).for_each(|k| points[k].push([done[k], told[k]]));
        }
        // What the network is told must ascend with what it does, value by value.
        let ascends = |points: &mut Vec<[f32; 2]>| {
            points.sort_by(|a, b| a[1].total_cmp(&b[1]));
            points.dedup_by(|b, a| b[1] - a[1] < 1e-3);
        };
        points.iter_mut().for_each(ascends);
        let [stirring, hands, head] = &points;
        let curve = |points: &[_]| ascending(points, name);
        Ok([curve(stirring)?, curve(hands)?, curve(head)?])
    };
    let reference = Some(curves("reference", SessionOptions::default().sampler)?);
    let student = engine.config().student.map(|_| curves("student", Sampler::Single)).transpose()?;
    (rest.reference, rest.student) = (reference, student);
    let wanted = mean(&rest.levels);
    for i in 0..SHIFTS {
        progress(EvalProgress { stage: "sessions at rest", done: i + 1, total: SHIFTS });
        let engine = with(&rest)?;
        let excess = |sampler: Sampler| -> Result<[f32; ACTIVITY]> {
            let options = SessionOptions { sampler, ..Default::default() };
            let rows = [true, false].map(|seen| Idle::of_sessions(&engine, &options, seen, threads, people::SESSIONS));
            let [seen, alone] = rows;
            let done = mean(&[measured(&seen?), measured(&alone?)]);
            Ok(std::array::from_fn(|k| done[k] - wanted[k]))
        };
        let samplers = [SessionOptions::default().sampler, Sampler::Single];
        for (curves, sampler) in [&mut rest.reference, &mut rest.student].into_iter().zip(samplers) {
            let Some(curves) = curves else { continue };
            for (curve, excess) in curves.iter_mut().zip(excess(sampler)?) {
                curve.0.iter_mut().for_each(|[done, _]| *done += excess);
            }
        }
    }
    Ok(rest)
}

/// Activity of all of `levels` one after the other: shares and speeds are averaged, not their
/// logarithms.
fn mean(levels: &[[f32; ACTIVITY]]) -> [f32; ACTIVITY] {
    let mean = |f: &dyn Fn(&[f32; ACTIVITY]) -> f32| levels.iter().map(f).sum::<f32>() / levels.len() as f32;
    [mean(&|l| l[0]), mean(&|l| (3.0 * l[1]).exp2()).log2() / 3.0, mean(&|l| (2.0 * l[2]).exp2()).log2() / 2.0]
}

/// Mean of `levels` whose stirring is near `stirring`, with that stirring.
fn along(levels: &[[f32; ACTIVITY]], stirring: f32) -> [f32; ACTIVITY] {
    let weight = |level: &[f32; ACTIVITY]| (-((level[0] - stirring) / NEAR).powi(2)).exp().max(1e-12);
    let sum: f32 = levels.iter().map(weight).sum();
    let mean = |k: usize| levels.iter().map(|level| weight(level) * level[k]).sum::<f32>() / sum;
    [stirring, mean(1), mean(2)]
}

/// Activity of a body at rest (`training/visavis_train/train/activity.py`).
fn measured(idle: &Idle) -> [f32; ACTIVITY] {
    let figures = &idle.figures;
    let speed = |v: Option<f64>, least: f64, middle: f64| (v.unwrap_or(0.0).max(least) / middle).log2();
    let stirring = 1.0 - figures.stillness.unwrap_or(1.0);
    let hands = speed(figures.hand_speed, 0.002, 0.04) / 3.0;
    [2.0 * stirring - 1.0, hands, speed(figures.head_speed, 0.001, 0.015) / 2.0].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Liveliness;

    #[test]
    fn points_lie_among_the_levels() {
        let levels: Vec<_> = (-10..=10).map(|i| i as f32 / 10.0).map(|x| [x, 0.5 * x, 0.2 + x]).collect();
        let [stirring, hands, head] = along(&levels, 0.3);
        assert_eq!(stirring, 0.3);
        assert!((hands - 0.15).abs() < 0.01 && (head - 0.5).abs() < 0.01, "{hands} {head}");
        assert!(along(&levels, 4.0).iter().all(|v| v.is_finite()), "far from all of them");
    }

    #[test]
    fn speeds_are_averaged_and_not_their_logarithms() {
        let [stirring, hands, head] = mean(&[[-1.0, -1.0, 0.0], [0.0, 1.0, 0.5]]);
        assert_eq!(stirring, -0.5);
        assert!((hands - ((0.125f32 + 8.0) / 2.0).log2() / 3.0).abs() < 1e-6);
        assert!((head - 1.5f32.log2() / 2.0).abs() < 1e-6);
    }

    #[test]
    fn activity_is_measured_as_it_is_told() {
        let figures = Liveliness {
            stillness: Some(0.25),
            hand_speed: Some(0.08),
            head_speed: Some(0.03),
            ..Liveliness::default()
        };
        let [stirring, hands, head] = measured(&Idle { name: String::new(), figures });
        assert_eq!(stirring, 0.5);
        assert!((hands - 1.0 / 3.0).abs() < 1e-6 && (head - 0.5).abs() < 1e-6);
    }
}
