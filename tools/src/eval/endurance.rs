//! Ten minutes without a break, and a user who leaves and comes back.

use super::figures::mean;
use super::motion::generate;
use super::parallel::each;
use super::window::Window;
use crate::metrics::{Summary, mean_and_error2};
use crate::recording::Recording;
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;
use visavis::internals::frame::FRAME_SAMPLES;
use visavis::stats::GuardStats;
use visavis::{Engine, FPS, Frame, Result, Root, SessionOptions};

/// Sessions that are averaged: single minutes differ by a third in how far feet slide, so few of
/// them tell nothing.
const RUNS: usize = 32;
/// Seconds that lead in, which are the end of a period: the user is on the way and the agent after
/// it when a period begins, the first one too.
const LEAD_IN: usize = 20;
/// Users who walk away and come back.
const WALKS: usize = 4;
/// The gaze target of a long run: free gaze changes its level by chance every few seconds, which
/// would pass for drift.
const GAZE: f32 = 0.8;

/// Metrics of a long run period by period: the same voices and the same way of the user come again
/// in each and the gaze target is the same throughout, so that only the agent can change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Endurance {
    /// Length of a period, seconds.
    pub period: usize,
    /// Periods of a run.
    pub periods: usize,
    /// Runs, each with a seed of its own, whose means these are.
    pub runs: usize,
    /// The metrics.
    pub changes: Vec<Change>,
    /// Whether every frame was finite.
    pub finite: bool,
    /// Times that the plausibility guard had to hold a pose, a minute of motion.
    pub trips_a_minute: f64,
    /// Part of all frames that it held.
    pub held: f64,
    /// Whether the guard had to step in so often that the bundle is defective
    /// ([`GuardStats::is_defective`]).
    pub defective: bool,
    /// The agent's mean distance from where it started, in the last period, metres.
    pub wandered: f64,
}

/// A metric from period to period.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Its name.
    pub metric: &'static str,
    /// Its mean over the runs in each period, from the first on.
    pub periods: Vec<f64>,
    /// Standard error of the difference between the last and the first, from how the runs differ;
    /// `None` of one run.
    pub error: Option<f64>,
    /// A difference up to this counts as none: a part of nearly nothing says nothing.
    pub least: f64,
}

/// What is compared: name, value, least difference that counts.
type Metric = (&'static str, fn(&Summary) -> Option<f64>, f64);

const METRICS: [Metric; 7] = [
    ("foot slide", |s| s.foot_slide, 0.01),
    ("support foot m/s", |s| s.support_foot_speed, 0.002),
    ("wrist var m/s", |s| s.wrist_speed, 0.02),
    ("head angle", |s| s.head_angle, 0.03),
    ("seam", |s| s.seam, 0.05),
    ("bone deviation", |s| Some(s.bone_deviation?.mean), 0.001),
    ("joint speed m/s", |s| Some(s.joint_speed?.mean), 0.01),
];

impl Change {
    /// The value in the first period; NaN where there is none.
    pub fn first(&self) -> f64 {
        self.periods.first().copied().unwrap_or(f64::NAN)
    }

    /// The value in the last period.
    pub fn last(&self) -> f64 {
        self.periods.last().copied().unwrap_or(f64::NAN)
    }

    /// The value that is furthest from the first one's.
    pub fn furthest(&self) -> f64 {
        let away = |v: &f64| (v - self.first()).abs();
        self.periods.iter().copied().max_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(f64::NAN)
    }

    /// Whether the value stays within `part` of the first in every period, or differs by nearly
    /// nothing.
    pub fn within(&self, part: f64) -> bool {
        (self.furthest() - self.first()).abs() <= self.least.max(part * self.first().abs())
    }
}

impl Endurance {
    /// Runs sessions over the voices of `windows`, again and again.
    pub(super) fn measure(
        engine: &Arc<Engine>,
        options: &SessionOptions,
        windows: &[Window],
        threads: usize,
        quick: bool,
    ) -> Result<Self> {
        let (period, periods, runs) = if quick { (20, 3, 1) } else { (60, 10, RUNS) };
        let (length, lead) = (period * FPS as usize, LEAD_IN * FPS as usize);
        let results = each(threads, runs, &|_| {}, &|run| {
            let late = length - lead;
            let again = |voice: Vec<f32>| Some([&voice[late * FRAME_SAMPLES..], &voice.repeat(periods)].concat());
            let voices = voices(windows, [run, runs], length).map(again);
            let user: Vec<Vec3> = (late..length * (periods + 1)).map(|i| circling(i % length, length)).collect();
            let options =
                SessionOptions { start: Root::default(), seed: run as u64, gaze: Some(GAZE), ..options.clone() };
            let outcome = generate(engine, options, voices, user, None)?;
            Ok(Run { guard: outcome.stats.guard, ..Run::of(&outcome.recording, lead, length) })
        })?;
        let (trips, held) =
            results.iter().fold((0, 0), |(trips, held), run| (trips + run.guard.trips, held + run.guard.held_frames));
        let guard = GuardStats { trips, held_frames: held, ..GuardStats::default() };
        let frames = runs * (lead + periods * length);
        let metric = |(name, value, least): &Metric| {
            let of = |run: &Run| run.periods.iter().map(value).collect::<Option<Vec<_>>>();
            let values: Vec<_> = results.iter().filter_map(of).collect();
            let differences: Vec<_> = values.iter().map(|v| v[periods - 1] - v[0]).collect();
            let error = (values.len() > 1).then(|| libm::sqrt(mean_and_error2(&differences).1));
            let periods = (0..periods).map(|i| mean(values.iter().map(|v| v[i]))).collect::<Option<_>>()?;
            Some(Change { metric: name, periods, error, least: *least })
        };
        Ok(Self {
            period,
            periods,
            runs,
            changes: METRICS.iter().filter_map(metric).collect(),
            finite: results.iter().all(|run| run.finite),
            trips_a_minute: trips as f64 * 60.0 * f64::from(FPS) / frames as f64,
            held: held as f64 / frames as f64,
            defective: guard.is_defective(frames as u64),
            wandered: results.iter().map(|run| run.wandered).sum::<f64>() / runs as f64,
        })
    }
}

struct Run {
    periods: Vec<Summary>,
    finite: bool,
    guard: GuardStats,
    wandered: f64,
}

impl Run {
    /// Of periods of `length` frames, which `lead` frames lead in.
    fn of(recording: &Recording, lead: usize, length: usize) -> Self {
        let frames = recording.frames.as_slice();
        let part = |from: usize, to: usize| {
            let voice = |v: &Option<Vec<f32>>| v.as_ref().map(|v| v[from * FRAME_SAMPLES..to * FRAME_SAMPLES].to_vec());
            Summary::of(&Recording {
                rig: recording.rig.clone(),
                frames: frames[from..to].to_vec(),
                user: recording.user[from..to].to_vec(),
                agent_voice: voice(&recording.agent_voice),
                user_voice: voice(&recording.user_voice),
                gaze_target: recording.gaze_target,
                sounds: None,
            })
        };
        let last = frames.len() - length;
        let periods = (0..(frames.len() - lead) / length).map(|i| lead + i * length);
        let periods = periods.map(|from| part(from, from + length)).collect();
        let finite = |f: &Frame| f.global.iter().all(|t| t.position.is_finite() && t.rotation.is_finite());
        let away = |f: &Frame| f.root.x.hypot(f.root.z);
        Self {
            periods,
            finite: frames.iter().all(finite),
            guard: GuardStats::default(),
            wandered: frames[last..].iter().map(away).sum::<f64>() / length as f64,
        }
    }
}

/// Both voices of windows one after the other until `frames` frames are full, beginning with
/// another window in each of `runs` runs.
fn voices(windows: &[Window], [run, runs]: [usize; 2], frames: usize) -> [Vec<f32>; 2] {
    let mut voices = [Vec::new(), Vec::new()];
    let mut order = windows.iter().cycle().skip(run * windows.len() / runs);
    while voices[0].len() < frames * FRAME_SAMPLES {
        let Some(window) = order.next() else { break };
        let length = window.truth.frames.len() * FRAME_SAMPLES;
        for (all, voice) in voices.iter_mut().zip([window.truth.agent(), window.truth.user()]) {
            all.extend(voice.unwrap_or_else(|| vec![0.0; length]));
        }
    }
    voices.iter_mut().for_each(|voice| voice.truncate(frames * FRAME_SAMPLES));
    voices
}

/// A user who sways from side to side of the agent, 1.3 to 1.9 m away, and is back after `length`
/// frames.
fn circling(i: usize, length: usize) -> Vec3 {
    let u = std::f32::consts::TAU * i as f32 / length as f32;
    let (angle, distance) = (0.9 * u.sin() + 0.3 * (3.0 * u).sin(), 1.6 + 0.3 * (2.0 * u).sin());
    Vec3::new(distance * angle.sin(), 1.65, distance * angle.cos())
}

/// A user who walks 6 m away, waits, comes back another way and waits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Follow {
    /// Runs, each with a seed of its own.
    pub runs: usize,
    /// Distance to the user at the end of the wait 6 m away, the worst run, metres.
    pub away: f64,
    /// Distance at the end of the wait after the way back, the worst run, metres.
    pub back: f64,
    /// Mean gaze score over the whole.
    pub head_angle: Option<f64>,
}

/// Seconds: standing, walking 6 m at 1.2 m/s, waiting.
const STAND: f32 = 4.0;
const WALK: f32 = 5.0;
const WAIT: f32 = 6.0;

impl Follow {
    pub(super) fn measure(
        engine: &Arc<Engine>,
        options: &SessionOptions,
        windows: &[Window],
        threads: usize,
        quick: bool,
    ) -> Result<Self> {
        let runs = if quick { 1 } else { WALKS };
        let seconds = |s: f32| (s * FPS as f32) as usize;
        let (there, end) = (seconds(STAND + WALK + WAIT), seconds(STAND + 2.0 * (WALK + WAIT)));
        let results = each(threads, runs, &|_| {}, &|run| {
            let voices = voices(windows, [run, runs], end).map(Some);
            let user: Vec<Vec3> = (0..end).map(|i| walking(i as f32 / FPS as f32)).collect();
            let options = SessionOptions { start: Root::default(), seed: run as u64, ..options.clone() };
            let recording = generate(engine, options, voices, user.iter().copied(), None)?.recording;
            let distance = |i: usize| {
                let (root, user) = (recording.frames[i].root, user[i]);
                (root.x - f64::from(user.x)).hypot(root.z - f64::from(user.z))
            };
            Ok((distance(there - 1), distance(end - 1), crate::metrics::head_angle(&recording)))
        })?;
        Ok(Self {
            runs,
            away: results.iter().map(|r| r.0).fold(0.0, f64::max),
            back: results.iter().map(|r| r.1).fold(0.0, f64::max),
            head_angle: mean(results.iter().filter_map(|r| r.2)),
        })
    }
}

/// Where the user is after `t` seconds: ahead, 6 m further along an arc, and back along another one
/// that leaves room for the agent.
fn walking(t: f32) -> Vec3 {
    let out = ((t - STAND) / WALK).clamp(0.0, 1.0);
    let home = ((t - STAND - WALK - WAIT) / WALK).clamp(0.0, 1.0);
    let aside = 0.3 * (std::f32::consts::PI * out).sin() - 1.5 * (std::f32::consts::PI * home).sin();
    Vec3::new(aside, 1.65, 1.5 + 6.0 * (out - home))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_in_the_middle_counts_as_much_as_the_last() {
        let of = |periods: &[f64]| Change { metric: "", periods: periods.to_vec(), error: None, least: 0.02 };
        let dance = of(&[0.1, 0.4, 0.1]);
        assert_eq!((dance.first(), dance.furthest(), dance.last()), (0.1, 0.4, 0.1));
        assert!(!dance.within(0.15) && !of(&[1.0, 0.8, 0.9]).within(0.15));
        assert!(of(&[1.0, 1.14, 0.9]).within(0.15), "within the part");
        assert!(of(&[0.01, 0.02, 0.0]).within(0.15), "within the least");
        assert!(!of(&[]).within(0.15), "nothing measured is not met");
    }
}
