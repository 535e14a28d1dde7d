//! Free-running sessions side by side: trajectories part, distributions must not.

use super::numerics::Loaded;
use super::spread::Spread;
use crate::metrics::{Moments, Summary, acceleration_moments, frechet, pose_moments};
use crate::offline::{self, Conversation};
use serde::Serialize;
use visavis::{Frame, Result, SessionOptions};

/// Points of the divergence curve.
const POINTS: usize = 60;

/// Free-running sessions over the same conversation.
#[derive(Debug, Clone, Serialize)]
pub struct FreeRun {
    /// Length, minutes.
    pub minutes: f64,
    /// The reference's metrics.
    pub reference: Measures,
    /// The reference with another seed, against the reference: what chance alone changes.
    pub other_seed: Measures,
    /// Each candidate, with the reference's seed.
    pub candidates: Vec<Measures>,
}

/// One run.
#[derive(Debug, Clone, Serialize)]
pub struct Measures {
    /// What ran.
    pub name: String,
    /// Frechet distance of its poses from the reference's run, m²; of the reference none.
    pub fgd: Option<f64>,
    /// Frechet distance of its joint accelerations from the reference's run, (m/s²)²; of the
    /// reference none.
    pub fgd_acceleration: Option<f64>,
    /// Metrics of its motion, as in `metrics.json`.
    pub summary: Summary,
    /// Distance of joints from the reference's at the same time, millimetres: mean over each piece
    /// of the run.
    pub divergence_mm: Vec<f64>,
    /// The same relative to the root: what differs of the posture.
    pub posture_mm: Spread,
    /// Times that recent motion was encoded anew.
    pub anchorings: u64,
}

/// A motion, kept for comparison.
struct Run {
    frames: Vec<Frame>,
    summary: Summary,
    poses: Moments,
    accelerations: Moments,
    anchorings: u64,
}

fn run(loaded: &Loaded, talk: &Conversation, seed: u64) -> Result<Run> {
    let mut session = loaded.engine.session(SessionOptions { seed, ..SessionOptions::default() })?;
    let outcome = offline::run(&mut session, talk, &mut |_| {})?;
    let frames = &outcome.recording.frames;
    Ok(Run {
        summary: Summary::of(&outcome.recording),
        poses: pose_moments(frames),
        accelerations: acceleration_moments(frames),
        anchorings: outcome.stats.anchorings,
        frames: outcome.recording.frames,
    })
}

impl Run {
    fn against(&self, reference: Option<&Run>, name: &str) -> Measures {
        let apart = |r: &Run, local: bool| -> Vec<f32> {
            let pairs = r.frames.iter().zip(&self.frames);
            pairs.map(|(a, b)| if local { posture(a, b) } else { distance(a, b) }).collect()
        };
        let curve = reference.map(|r| apart(r, false)).unwrap_or_default();
        let piece = curve.len().div_ceil(POINTS).max(1);
        Measures {
            name: name.to_owned(),
            fgd: reference.and_then(|r| frechet(&r.poses, &self.poses)),
            fgd_acceleration: reference.and_then(|r| frechet(&r.accelerations, &self.accelerations)),
            summary: self.summary.clone(),
            divergence_mm: curve.chunks(piece).map(|c| Spread::of(c, 1000.0).mean).collect(),
            posture_mm: Spread::of(&reference.map(|r| apart(r, true)).unwrap_or_default(), 1000.0),
            anchorings: self.anchorings,
        }
    }
}

/// Mean distance of the joints of two frames, metres.
fn distance(a: &Frame, b: &Frame) -> f32 {
    let pairs = a.global.iter().zip(&b.global);
    pairs.map(|(a, b)| a.position.distance(b.position)).sum::<f32>() / a.global.len().max(1) as f32
}

/// The same in each frame's own root frame.
fn posture(a: &Frame, b: &Frame) -> f32 {
    let pairs = a.global.iter().zip(&b.global);
    let apart = pairs.map(|(p, q)| a.root.to_local(p.position).distance(b.root.to_local(q.position)));
    apart.sum::<f32>() / a.global.len().max(1) as f32
}

/// Runs all bundles over `talk`.
pub(super) fn measure(
    reference: &Loaded,
    candidates: &[Loaded],
    talk: &Conversation,
    progress: &dyn Fn(&str),
) -> Result<FreeRun> {
    let minutes = talk.seconds() / 60.0;
    let all: Vec<_> = [(reference, 0), (reference, 1)].into_iter().chain(candidates.iter().map(|c| (c, 0))).collect();
    progress(&format!("{} free runs of {minutes:.1} minutes, two at a time", all.len()));
    let mut runs = Vec::with_capacity(all.len());
    for pair in all.chunks(2) {
        let done = std::thread::scope(|scope| {
            let started: Vec<_> =
                pair.iter().map(|(loaded, seed)| scope.spawn(move || run(loaded, talk, *seed))).collect();
            started.into_iter().map(|run| run.join()).collect::<Vec<_>>()
        });
        for run in done {
            runs.push(run.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
        }
    }
    let base = &runs[0];
    Ok(FreeRun {
        minutes,
        reference: base.against(None, &reference.name),
        other_seed: runs[1].against(Some(base), "reference, another seed"),
        candidates: candidates.iter().zip(&runs[2..]).map(|(c, run)| run.against(Some(base), &c.name)).collect(),
    })
}
