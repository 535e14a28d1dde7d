//! What the activity that a model is told at rest does to its body, measured on silent sessions.

use super::EvalProgress;
use super::calibrate::ascending;
use super::clip::Clip;
use super::motion;
use super::parallel::each;
use super::people::{self, Idle, Real};
use super::window::{LEAD, Window};
use crate::metrics::{Liveliness, Tally};
use std::sync::Arc;
use visavis::internals::config::{ACTIVITY, RestConfig, RestResponse};
use visavis::internals::session::Diagnostics;
use visavis::{Engine, Result, Sampler, SessionOptions};

/// Shares of stirring, as the network is told them, at which the body is measured.
const STIRRING: [f32; 9] = [-1.0, -0.85, -0.65, -0.4, -0.15, 0.1, 0.4, 0.7, 1.0];
/// Stretches whose stirring differs by so much count for a point by a third.
const NEAR: f32 = 0.15;
/// Seconds of a session of a point, and of one in which the whole is set right.
const SHORT: usize = 40;
const LONG: usize = 120;
/// By how much the time for which a body is told the same grows in a round at most, and its limits,
/// seconds.
const LONGER: f64 = 1.4;
const HELD: [f32; 2] = [5.0, 40.0];
/// Largest offset: it takes any level to an end of the curves, and what that does not reach is out of
/// reach.
const MOST: f32 = 2.0;
/// Times that sessions are brought nearer to what is wanted.
const ROUNDS: usize = 3;

/// Measures how active a model's body is as a function of what it is told, for both its networks,
/// along the line on which the stretches of real people lie. Bodies also stir because they are told
/// something else: what is asked of them is then shifted until sessions are as active as people on
/// average before a user who is silent and alone, and as the agents of `clips` are who listen; and
/// they are told the same for so long that their hands change their place as often as people's.
///
/// Listeners are looked for in `5 windows` windows of the clips at most; there are `windows / 4`
/// silent sessions of 40 s for each of nine points, and in each of three rounds `windows / 2` of two
/// minutes with a user and as many without: with 32, hand speed is known to a twentieth. `with`
/// makes an engine of the model with responses; what `rest` holds of them makes no difference.
///
/// # Errors
/// Those of clips, of sessions and of `with`; [`visavis::ErrorKind::Argument`] for a model that does
/// not do what it is told.
pub fn calibrate_rest(
    rest: &RestConfig,
    clips: &[Clip],
    windows: usize,
    with: &dyn Fn(&RestConfig) -> Result<Arc<Engine>>,
    threads: usize,
    progress: &(dyn Fn(EvalProgress<'_>) + Sync),
) -> Result<RestConfig> {
    let mut rest = RestConfig { reference: None, student: None, ..rest.clone() };
    let engine = with(&rest)?;
    let response = |name: &str, sampler: Sampler| -> Result<RestResponse> {
        let told = |i| progress(EvalProgress { stage: &format!("{name}, activity"), done: i, total: STIRRING.len() });
        let sessions = ((windows / 4).max(1), SHORT);
        let curves = curves(&engine, &rest.levels, sampler, (threads, sessions), &told)?;
        let [stirring, hands, head] = curves.each_ref().map(|points| ascending(points, name));
        let (none, seconds) = ([0.0; ACTIVITY], rest.seconds);
        Ok(RestResponse { curves: [stirring?, hands?, head?], alone: none, listening: none, seconds })
    };
    let reference = Some(response("reference", SessionOptions::default().sampler)?);
    let student = engine.config().student.map(|_| response("student", Sampler::Single)).transpose()?;
    (rest.reference, rest.student) = (reference, student);
    let wanted = Wanted {
        idle: mean(&rest.levels),
        changes: Real::read()?.idle.rest_changes,
        listeners: Listeners::of(&engine, clips, 5 * windows)?,
    };
    for i in 0..ROUNDS {
        progress(EvalProgress { stage: "sessions at rest", done: i + 1, total: ROUNDS });
        let engine = with(&rest)?;
        let sessions = ((windows / 2).max(1), LONG);
        let samplers = [SessionOptions::default().sampler, Sampler::Single];
        for (response, sampler) in [&mut rest.reference, &mut rest.student].into_iter().zip(samplers) {
            if let Some(response) = response {
                let options = SessionOptions { sampler, ..Default::default() };
                wanted.approach(response, &engine, &options, (threads, sessions))?;
            }
        }
    }
    Ok(rest)
}

/// What sessions are to do.
struct Wanted {
    /// Activity of people at rest.
    idle: [f32; ACTIVITY],
    /// Changes of their hands' rest place a minute.
    changes: Option<f64>,
    /// Agents who listen.
    listeners: Listeners,
}

impl Wanted {
    /// Shifts what is asked for by what sessions of `engine`, which has this response, lack.
    fn approach(
        &self,
        response: &mut RestResponse,
        engine: &Arc<Engine>,
        options: &SessionOptions,
        (threads, sessions): (usize, (usize, usize)),
    ) -> Result<()> {
        let idle = |seen| Idle::of_sessions(engine, options, seen, threads, sessions);
        let (seen, alone) = (idle(true)?.figures, idle(false)?.figures);
        let silent = less(self.idle, measured(&seen));
        for (curve, missing) in response.curves.iter_mut().zip(silent) {
            curve.0.iter_mut().for_each(|[done, _]| *done -= missing);
        }
        // The curves have moved for the others too.
        response.alone = grown(response.alone, less(less(self.idle, measured(&alone)), silent));
        if let Some(missing) = self.listeners.missing(engine, options, threads)? {
            response.listening = grown(response.listening, less(missing, silent));
        }
        if let (Some(seen), Some(alone), Some(people)) = (seen.rest_changes, alone.rest_changes, self.changes) {
            let longer = (0.5 * (seen + alone) / people).clamp(1.0 / LONGER, LONGER);
            response.seconds = (response.seconds * longer as f32).clamp(HELD[0], HELD[1]);
        }
        Ok(())
    }
}

/// What a body before a silent user does as it is told: points (done, told) of each value, ascending
/// by what is told.
fn curves(
    engine: &Arc<Engine>,
    levels: &[[f32; ACTIVITY]],
    sampler: Sampler,
    (threads, sessions): (usize, (usize, usize)),
    progress: &dyn Fn(usize),
) -> Result<[Vec<[f32; 2]>; ACTIVITY]> {
    let mut points = [const { Vec::new() }; ACTIVITY];
    for (i, stirring) in STIRRING.into_iter().enumerate() {
        progress(i + 1);
        let told = along(levels, stirring);
        let diagnostics = Diagnostics { activity: Some(told), ..Default::default() };
        let options = SessionOptions { sampler, diagnostics, ..Default::default() };
        let done = measured(&Idle::of_sessions(engine, &options, true, threads, sessions)?.figures);
        (0..ACTIVITY).for_each(|k| points[k].push([done[k], told[k]]));
    }
    for points in &mut points {
        points.sort_by(|a, b| a[1].total_cmp(&b[1]));
        points.dedup_by(|b, a| b[1] - a[1] < 1e-3);
    }
    Ok(points)
}

/// Windows in which agents listen, and what they do meanwhile.
struct Listeners {
    windows: Vec<(Window, Vec<bool>)>,
    done: Liveliness,
}

impl Listeners {
    fn of(engine: &Engine, clips: &[Clip], most: usize) -> Result<Self> {
        let rig = &engine.config().rig;
        let windows = Window::choose(clips, most)?.into_iter().filter_map(|window| {
            let mask = people::listening(&window.segment).split_off(LEAD);
            mask.contains(&true).then_some((window, mask))
        });
        let windows: Vec<_> = windows.collect();
        let mut tally = Tally::default();
        windows.iter().for_each(|(window, mask)| tally.add(rig, &window.truth.frames, mask));
        Ok(Self { windows, done: tally.row() })
    }

    /// What sessions in the same windows lack of their activity; nothing where nobody listens.
    fn missing(
        &self,
        engine: &Arc<Engine>,
        options: &SessionOptions,
        threads: usize,
    ) -> Result<Option<[f32; ACTIVITY]>> {
        let tallies = each(threads, self.windows.len(), &|_| {}, &|i| {
            let (window, mask) = &self.windows[i];
            let options = SessionOptions { seed: options.seed + i as u64, ..options.clone() };
            let mut tally = Tally::default();
            tally.add(&engine.config().rig, &motion::in_window(engine, &options, window)?, mask);
            Ok(tally)
        })?;
        let done = Tally::sum(tallies).row();
        Ok((done.seconds > 0.0).then(|| less(measured(&self.done), measured(&done))))
    }
}

/// An offset and what is missing yet, no more than [`MOST`].
fn grown(offset: [f32; ACTIVITY], missing: [f32; ACTIVITY]) -> [f32; ACTIVITY] {
    std::array::from_fn(|i| (offset[i] + missing[i]).clamp(-MOST, MOST))
}

fn less(a: [f32; ACTIVITY], b: [f32; ACTIVITY]) -> [f32; ACTIVITY] {
    std::array::from_fn(|i| a[i] - b[i])
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
fn measured(figures: &Liveliness) -> [f32; ACTIVITY] {
    let speed = |v: Option<f64>, least: f64, middle: f64| (v.unwrap_or(0.0).max(least) / middle).log2();
    let stirring = 1.0 - figures.stillness.unwrap_or(1.0);
    let hands = speed(figures.hand_speed, 0.002, 0.04) / 3.0;
    [2.0 * stirring - 1.0, hands, speed(figures.head_speed, 0.001, 0.015) / 2.0].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let [stirring, hands, head] = measured(&figures);
        assert_eq!(stirring, 0.5);
        assert!((hands - 1.0 / 3.0).abs() < 1e-6 && (head - 0.5).abs() < 1e-6);
    }
}
