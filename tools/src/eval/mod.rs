//! Is the motion any good? A bundle judged on recorded conversations.
//!
//! ```text
//! clips -> windows -> rows: corpus, Random, NN, VAE, samplers, made elsewhere, gaze targets
//!                     -> Report -> text, JSON, Markdown; the motion itself as files
//!                  -> reconstruction, reaction time, endurance, following        -> verdicts on the targets
//! ```
//!
//! A [`Window`] is 13.3 s of a clip. The model is given its voices and the way of its user,
//! starting where the clip's agent stands two seconds earlier; then all motions are measured over
//! the same frames by the same code ([`crate::metrics`]), the corpus' own included, and motion that
//! something else made. What is measured is what is played: joints on the rig. Everything is
//! deterministic: same bundle, clips and options, same figures, on any number of threads.
//!
//! ```no_run
//! # fn main() -> visavis::Result<()> {
//! use visavis::Engine;
//! use visavis_tools::eval::{Clip, EvalOptions, evaluate};
//!
//! let engine = Engine::load("models/visavis-room-i8.safetensors")?;
//! let clips = Clip::list("corpus/test", &engine.config().rig)?;
//! let report = evaluate(&engine, &clips, None, &EvalOptions::default(), &|_| {})?;
//! println!("{}", report.to_text());
//! # Ok(())
//! # }
//! ```

mod activity;
mod bank;
mod calibrate;
mod clip;
mod elsewhere;
mod endurance;
mod figures;
mod keep;
mod motion;
mod options;
mod parallel;
mod people;
mod played;
mod reaction;
mod reconstruction;
mod report;
mod synthetic;
mod targets;
mod window;

pub use activity::calibrate_rest;
pub use bank::Bank;
pub use calibrate::calibrate;
pub use clip::{Clip, Segment};
pub use endurance::{Change, Endurance, Follow};
pub use figures::{CORRECT, Figures, Row};
pub use options::EvalOptions;
pub use people::Idle;
pub use reaction::{FOUND, PATIENCE, Reaction};
pub use reconstruction::Reconstruction;
pub use synthetic::synthetic;
pub use targets::Verdict;
pub use window::{LEAD, WINDOW, Window};

use crate::contents::made_with;
use elsewhere::Elsewhere;
use figures::Measured;
use keep::Keep;
use parallel::each;
use played::Played;
use serde::Serialize;
use std::sync::Arc;
use visavis::{Engine, Error, ErrorKind, Frame, Result, Sampler, SessionOptions};

/// Gaze targets of the dial (SARAH table 2).
pub const GAZE_TARGETS: [f32; 5] = [0.0, 0.25, 0.5, 0.8, 1.0];

/// The gaze dial of a sampler (SARAH table 2).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Dial {
    /// The sampler.
    pub sampler: String,
    /// Gaze targets.
    pub targets: Vec<f32>,
    /// Mean gaze score at each.
    pub reached: Vec<f64>,
    /// Windows in which the corpus' own agent has a mean score within 0.1 of the target.
    pub windows: Vec<usize>,
}

/// All figures of a bundle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Name of the model.
    pub model: String,
    /// Clips that there were, and windows that were measured.
    pub clips: usize,
    /// Windows, in all and in which the agent speaks.
    pub windows: [usize; 2],
    /// Whether this was a quick look.
    pub quick: bool,
    /// What Random and NN looked up their motion in.
    pub bank: String,
    /// `corpus`, `Random`, `NN` (these two where they were asked for), `VAE` (the corpus' motion
    /// through the autoencoder, where there is one), the samplers with free gaze, rows made
    /// elsewhere, then the gaze targets.
    pub rows: Vec<Row>,
    /// Nobody speaks and the user stands: `real people`, `corpus` where it has such stretches, then
    /// the samplers, each also where no user is seen.
    pub idle: Vec<Idle>,
    /// How lively real people are who talk.
    pub real_talk: crate::metrics::Liveliness,
    /// The gaze dial of the first sampler and of the single step.
    pub dials: Vec<Dial>,
    /// What the autoencoder loses; of bundles that have one.
    pub reconstruction: Option<Reconstruction>,
    /// Reaction times of the first sampler.
    pub reaction: Option<Reaction>,
    /// A long run of the first sampler.
    pub endurance: Option<Endurance>,
    /// A user who walks away.
    pub follow: Option<Follow>,
    /// Targets, met or missed.
    pub verdicts: Vec<Verdict>,
}

/// How far an evaluation has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EvalProgress<'a> {
    /// What is measured.
    pub stage: &'a str,
    /// Windows of it that are done, and that there are.
    pub done: usize,
    /// Windows that there are; 0 where a stage is not counted.
    pub total: usize,
}

/// Evaluates a bundle on `clips`; `bank` are other clips, best those of training, in which Random
/// and NN look up their motion.
///
/// # Errors
/// Those of [`Clip::read`], [`Window::choose`] and of sessions made with the options;
/// [`ErrorKind::Argument`] for options that make no sense, and for rows whose files are missing or
/// not of the windows; [`ErrorKind::Io`] for files that cannot be written.
pub fn evaluate(
    engine: &Arc<Engine>,
    clips: &[Clip],
    bank: Option<&[Clip]>,
    options: &EvalOptions,
    progress: &(dyn Fn(EvalProgress<'_>) + Sync),
) -> Result<Report> {
    let windows = Window::choose(clips, options.windows)?;
    let tell = |stage: &str| progress(EvalProgress { stage, done: 0, total: 0 });
    let rig = &engine.config().rig;
    let (samplers, encodes) = (samplers_of(engine, options)?, engine.needs_sarah().is_ok());
    let mut taken: Vec<_> = samplers.iter().map(|&sampler| made_with(engine, sampler)).collect();
    let mut elsewhere = Vec::new();
    for row in &options.rows {
        elsewhere.push(Elsewhere::open(row, &taken, &windows, clips, rig)?);
        taken.push(row.0.clone());
    }
    let keep = options.keep.as_ref().map(|dir| Keep::new(dir, clips, &engine.config().name)).transpose()?;
    let judge = Judge { engine, windows: &windows, options, keep, progress };

    let recorded = |frames: Vec<Frame>| Played::recorded(rig, frames);
    let truth = |_: usize, window: &Window| Ok(Some(recorded(window.truth.frames.clone())));
    let truth = judge.measure("corpus", true, &truth)?.unwrap_or_default();
    let mut rows = vec![Row::new("corpus".into(), None, &truth, &truth)];
    let mut searched = "nothing".to_owned();
    if !options.motion_only {
        tell("bank");
        let own = bank.is_none();
        let bank = Bank::new(bank.unwrap_or(clips).to_vec(), own)?;
        let random = |i: usize, window: &Window| Ok(bank.random(window, i as u64)?.map(recorded));
        let nearest = |_: usize, window: &Window| Ok(bank.nearest(window)?.map(recorded));
        for (name, source) in [("Random", &random as Source<'_>), ("NN", &nearest)] {
            if let Some(motion) = judge.measure(name, true, source)? {
                rows.push(Row::new(name.into(), None, &motion, &truth));
            }
        }
        searched = format!("{} stretches of {}", bank.len(), if own { "the other clips" } else { "the bank" });
    }
    if encodes {
        let through = |_: usize, window: &Window| {
            let mut frames = engine.round_trip_shown(&window.segment.frames)?;
            Ok(Some(Played::shown(rig, frames.split_off(LEAD))))
        };
        let motion = judge.measure("VAE", true, &through)?.unwrap_or_default();
        rows.push(Row::new("VAE".into(), None, &motion, &truth));
    }
    for &sampler in &samplers {
        rows.push(judge.row(sampler, None, &truth)?);
    }
    for row in &elsewhere {
        let motion = judge.measure(&row.name, true, &|i, _| Ok(Some(Played::fitted(rig, row.motion(i)?)?)))?;
        rows.push(Row::new(row.name.clone(), None, &motion.unwrap_or_default(), &truth));
    }
    let mut dials = Vec::new();
    for (i, &sampler) in samplers.iter().enumerate() {
        if options.motion_only || i > 0 && sampler != Sampler::Single {
            continue;
        }
        let dialled: Vec<Row> =
            GAZE_TARGETS.iter().map(|&g| judge.row(sampler, Some(g), &truth)).collect::<Result<_>>()?;
        dials.push(Dial::new(made_with(engine, sampler), &dialled, &truth));
        rows.extend(dialled);
    }

    tell("at rest");
    let real = people::Real::read()?;
    let mut idle = vec![Idle { name: "real people".into(), figures: real.idle }];
    idle.extend(Idle::of_clips(rig, clips)?);
    let sessions = if options.quick { people::FEW } else { people::SESSIONS };
    for &sampler in &samplers {
        let seed = u64::from(options.seed) << 32;
        let session = SessionOptions { sampler, gaze: None, seed, ..options.session.clone() };
        for seen in [true, false] {
            idle.push(Idle::of_sessions(engine, &session, seen, options.threads, sessions)?);
        }
    }

    let session = SessionOptions { sampler: samplers[0], gaze: None, ..options.session.clone() };
    let (threads, quick) = (options.threads, options.quick);
    tell("reconstruction");
    let reconstruction = encodes.then(|| Reconstruction::measure(engine, &windows, threads)).transpose()?;
    let (mut reaction, mut follow, mut endurance) = (None, None, None);
    if !options.motion_only {
        tell("reaction time");
        reaction = Some(Reaction::measure(engine, &session, clips, &windows, threads, quick)?);
        tell("following");
        follow = Some(Follow::measure(engine, &session, &windows, threads, quick)?);
        tell("endurance");
        endurance = Some(Endurance::measure(engine, &session, &windows, threads, quick)?);
    }
    let mut report = Report {
        model: engine.config().name.clone(),
        clips: clips.len(),
        windows: [windows.len(), windows.iter().filter(|w| w.speaking).count()],
        quick,
        bank: searched,
        rows,
        idle,
        real_talk: real.speaking,
        dials,
        reconstruction,
        reaction,
        endurance,
        follow,
        verdicts: Vec::new(),
    };
    report.verdicts = targets::verdicts(&report);
    Ok(report)
}

/// Motion in a window, given its number; `None` where there is none.
type Source<'a> = &'a (dyn Fn(usize, &Window) -> Result<Option<Played>> + Sync);

/// Measures motions in the same windows.
struct Judge<'a> {
    engine: &'a Arc<Engine>,
    windows: &'a [Window],
    options: &'a EvalOptions,
    keep: Option<Keep<'a>>,
    progress: &'a (dyn Fn(EvalProgress<'_>) + Sync),
}

impl Judge<'_> {
    /// Every window's motion in a row measured and, where rows are kept, `kept`; `None` if any
    /// window has none.
    fn measure(&self, row: &str, kept: bool, source: Source<'_>) -> Result<Option<Vec<Measured>>> {
        let rig = &self.engine.config().rig;
        let total = self.windows.len();
        let done = |done| (self.progress)(EvalProgress { stage: row, done, total });
        let keep = self.keep.as_ref().filter(|_| kept);
        let measured = each(self.options.threads, total, &done, &|i| {
            let window = &self.windows[i];
            let Some(motion) = source(i, window)? else { return Ok(None) };
            if let Some(keep) = keep {
                keep.write(row, i, window, &motion.frames, row == "corpus")?;
            }
            Measured::of(rig, window, motion).map(Some)
        })?;
        let measured: Option<Vec<_>> = measured.into_iter().collect();
        if let (None, Some(keep)) = (&measured, keep) {
            keep.forget(row)?;
        }
        Ok(measured)
    }

    /// The row of a sampler at a gaze target.
    fn row(&self, sampler: Sampler, gaze: Option<f32>, truth: &[Measured]) -> Result<Row> {
        let made = made_with(self.engine, sampler);
        let name = gaze.map_or_else(|| made.clone(), |g| format!("{made}, gaze {g}"));
        let motion = self.measure(&name, gaze.is_none(), &|i, window| {
            let seed = u64::from(self.options.seed) << 32 | i as u64;
            let options = SessionOptions { sampler, gaze, seed, ..self.options.session.clone() };
            let frames = motion::in_window(self.engine, &options, window)?;
            Ok(Some(Played::shown(&self.engine.config().rig, frames)))
        })?;
        Ok(Row::new(name, gaze, &motion.unwrap_or_default(), truth).by_model())
    }
}

/// The samplers to compare that the bundle has.
fn samplers_of(engine: &Engine, options: &EvalOptions) -> Result<Vec<Sampler>> {
    let has = |s: &Sampler| *s != Sampler::Single || engine.config().student.is_some();
    let mut samplers: Vec<_> = options.samplers.iter().copied().filter(has).collect();
    if engine.needs_sarah().is_err() {
        // Without samplers all rows would be the same.
        samplers.truncate(1);
    }
    if samplers.is_empty() {
        return Err(Error::new(ErrorKind::Argument, "no sampler to evaluate that this bundle has"));
    }
    Ok(samplers)
}

impl Dial {
    fn new(sampler: String, rows: &[Row], truth: &[Measured]) -> Self {
        let near = |target: f32| {
            let close = |m: &&Measured| m.head_angle().is_some_and(|g| (g - f64::from(target)).abs() <= 0.1);
            truth.iter().filter(close).count()
        };
        let reached = rows.iter().map(|row| row.all.head_angle.unwrap_or(f64::NAN)).collect();
        let windows = GAZE_TARGETS.iter().map(|&t| near(t)).collect();
        Self { sampler, targets: GAZE_TARGETS.to_vec(), reached, windows }
    }
}

impl Report {
    /// The row of this name.
    pub fn row(&self, name: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.name == name)
    }

    /// The rows of the model with free gaze.
    pub fn models(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| row.gaze_target.is_none() && row.model)
    }
}

#[cfg(test)]
mod tests;
