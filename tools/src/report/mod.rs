//! The accuracy report: what quantised bundles do to the numbers, the blocks and the motion of a
//! reference bundle, and what they cost.
//!
//! | file | what |
//! |---|---|
//! | `numerics` | tensors, layer outputs on real inputs, teacher-forced blocks: the same on every machine |
//! | `judged` | metrics of `visavis eval` on recorded conversations, side by side |
//! | `free` | free-running sessions: divergence, metrics side by side |
//! | `speed` | block times in turns, bytes read, memory |
//! | `targets` | what each scheme is held to |
//! | `render`, `document`, `chart` | the report as Markdown and as one HTML page |

mod chart;
mod document;
mod free;
mod judged;
mod numerics;
mod render;
mod speed;
mod spread;
mod targets;

pub use free::{FreeRun, Measures};
pub use judged::{FgdChange, Judged};
pub use numerics::{Blocks, CandidateNumerics, JointRow, LayerOutput, Numerics, TensorRow};
pub use speed::Speed;
pub use spread::Spread;
pub use targets::Target;

use crate::contents::Contents;
use crate::offline::Conversation;
use numerics::Loaded;
use serde::Serialize;
use std::path::{Path, PathBuf};
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::{BundleFile, Engine, Error, ErrorKind, Result};

/// What to measure.
pub struct Options<'a> {
    /// The bundle that all are compared with.
    pub reference: PathBuf,
    /// The bundles to measure.
    pub candidates: Vec<PathBuf>,
    /// The conversation that blocks are made of; repeated as often as it takes for free runs.
    pub talk: &'a Conversation,
    /// Blocks of it that are compared teacher-forced.
    pub blocks: usize,
    /// Length of the free runs, minutes.
    pub minutes: f64,
    /// Blocks that are timed of each bundle and sampler.
    pub timed: usize,
    /// Numerics of another machine, to be compared with those of this one.
    pub other: Option<Numerics>,
    /// What `visavis eval --json` wrote for the reference and for each candidate on the same clips;
    /// none, or one each.
    pub eval: Vec<PathBuf>,
    /// The same for the reference with another seed: what chance alone changes.
    pub eval_other_seed: Option<PathBuf>,
    /// Told what is being done.
    pub progress: &'a dyn Fn(&str),
}

/// Everything that was measured.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Program and version.
    pub made_by: String,
    /// Name of the reference's file.
    pub reference: String,
    /// Schemes that the reference's matrices are stored in.
    pub reference_schemes: String,
    /// Bytes that the reference's parameters take as f32.
    pub f32_bytes: usize,
    /// Size of each candidate over `f32_bytes`.
    pub sizes: Vec<f64>,
    /// Scheme that each candidate was made for.
    pub schemes: Vec<Scheme>,
    /// Tensors, layers and teacher-forced blocks.
    pub numerics: Numerics,
    /// Free-running sessions.
    pub free: FreeRun,
    /// Metrics on recorded conversations.
    pub judged: Option<Judged>,
    /// Costs, the reference first.
    pub speed: Vec<Speed>,
    /// Targets of each candidate.
    pub targets: Vec<Vec<Target>>,
    /// The same numerics, over as many blocks, on another machine and on this one.
    pub machines: Option<[Numerics; 2]>,
}

/// Measures all of it.
///
/// # Errors
/// Those of loading; [`ErrorKind::Argument`] when a candidate has another rig or other sizes than
/// the reference.
pub fn run(options: &Options<'_>) -> Result<Report> {
    if !options.eval.is_empty() && options.eval.len() != 1 + options.candidates.len() {
        let message = "evaluations: give one of the reference, then one of each candidate, or none";
        return Err(Error::new(ErrorKind::Argument, message));
    }
    let other_seed = options.eval_other_seed.as_deref();
    let judged = (!options.eval.is_empty()).then(|| Judged::read(&options.eval, other_seed)).transpose()?;
    let (reference, candidates) = load(options)?;
    let progress = options.progress;
    let scene = options.talk.scene(options.blocks, None)?;
    let numerics = numerics::measure(&reference, &candidates, &scene, progress)?;
    let machines = match &options.other {
        None => None,
        Some(other) => {
            let scene = options.talk.scene(other.blocks, None)?;
            Some([other.clone(), numerics::measure(&reference, &candidates, &scene, &|_| {})?])
        }
    };
    let free = free::measure(&reference, &candidates, &repeated(options.talk, options.minutes)?, progress)?;
    let all: Vec<_> = std::iter::once(&reference).chain(&candidates).collect();
    let speed = speed::measure(&all, options.timed, progress)?;

    let contents = Contents::of(&reference.file)?;
    let f32_bytes = contents.tensors.iter().map(|t| 4 * t.elements()).sum::<usize>();
    let sizes: Vec<_> = candidates.iter().map(|c| c.file.len() as f64 / f32_bytes as f64).collect();
    let schemes: Vec<_> = candidates.iter().map(scheme).collect();
    let fgd_change = |i: usize| judged.as_ref().and_then(|j| j.worst(i));
    let targets = (numerics.candidates.iter().zip(&sizes).zip(&schemes).enumerate())
        .map(|(i, ((n, size), scheme))| targets::targets(*scheme, n, *size, fgd_change(i)))
        .collect();
    Ok(Report {
        made_by: format!("visavis {}", env!("CARGO_PKG_VERSION")),
        reference_schemes: matrices(&reference)?,
        reference: reference.name,
        f32_bytes,
        sizes,
        schemes,
        numerics,
        free,
        judged,
        speed,
        targets,
        machines,
    })
}

/// The part of the report that depends on the bundles alone, to be compared with another machine's.
///
/// # Errors
/// As [`run`].
pub fn numerics(options: &Options<'_>) -> Result<Numerics> {
    let (reference, candidates) = load(options)?;
    numerics::measure(&reference, &candidates, &options.talk.scene(options.blocks, None)?, options.progress)
}

impl Report {
    /// As Markdown.
    pub fn markdown(&self) -> String {
        render::document(self).markdown()
    }

    /// As one HTML page, pictures inside.
    pub fn html(&self) -> String {
        render::document(self).html("Visavis: accuracy of quantised bundles")
    }
}

fn load(options: &Options<'_>) -> Result<(Loaded, Vec<Loaded>)> {
    let kernels = Kernels::detect()?;
    let load = |path: &Path| -> Result<_> {
        let file = BundleFile::open(path)?;
        let engine = Engine::from_file(&file, kernels)?;
        let name = path.file_stem().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
        Ok(Loaded { name, file, engine })
    };
    let reference = load(&options.reference)?;
    if let Some(Scheme::I8 | Scheme::I4) = reference.engine.config().quantisation.as_ref().map(|q| q.scheme) {
        let message = "is quantised; the reference is the bundle of floats that the others were made from";
        return Err(Error::new(ErrorKind::Argument, message).with_path(&options.reference));
    }
    Ok((reference, options.candidates.iter().map(|p| load(p)).collect::<Result<_>>()?))
}

fn scheme(loaded: &Loaded) -> Scheme {
    loaded.engine.config().quantisation.as_ref().map_or(Scheme::F16, |q| q.scheme)
}

fn matrices(loaded: &Loaded) -> Result<String> {
    let (_, tensors) = loaded.file.parse()?;
    let mut schemes: Vec<_> =
        visavis::internals::quant::layers(&tensors)?.iter().map(|l| l.weights.scheme().to_string()).collect();
    schemes.sort_unstable();
    schemes.dedup();
    Ok(schemes.join(", "))
}

/// `talk` one time after the other until it lasts `minutes`; the user's path goes back and forth,
/// so that nobody jumps.
fn repeated(talk: &Conversation, minutes: f64) -> Result<Conversation> {
    let times = (minutes * 60.0 / talk.seconds()).ceil().max(1.0) as usize;
    let length = talk.frames() * visavis::internals::frame::FRAME_SAMPLES;
    let voice = |v: Option<&[f32]>| {
        v.map(|v| {
            let mut once = v.to_vec();
            once.resize(length, 0.0);
            once.repeat(times)
        })
    };
    let seconds = talk.frames() as f64 / f64::from(visavis::FPS);
    let path = talk.path().map(|path| {
        let mut points: Vec<_> = path.points().iter().filter(|(t, _)| (0.0..seconds).contains(t)).copied().collect();
        let once = points.clone();
        for i in 1..times {
            let turned = |(t, p): (f64, glam::Vec3)| {
                let t = if i % 2 == 1 { seconds - t } else { t };
                (t + i as f64 * seconds, p)
            };
            match i % 2 {
                1 => points.extend(once.iter().rev().copied().map(turned)),
                _ => points.extend(once.iter().copied().map(turned)),
            }
        }
        points.dedup_by(|b, a| b.0 <= a.0);
        points
    });
    let path = path.map(crate::offline::UserPath::from_points).transpose()?;
    Conversation::new(voice(talk.agent()), voice(talk.user()), path)
}
