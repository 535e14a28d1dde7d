//! What motion measures, window by window, and what a row of the table says.

use super::people::speech;
use super::played::Played;
use super::window::Window;
use crate::metrics::{
    Liveliness, Moments, NodTally, Nods, Space, Split, Summary, Tally, acceleration_moments, ape, frechet, pck,
    pose_moments,
};
use serde::Serialize;
use visavis::{Result, Rig};

/// Windows whose poses make up one batch of the mean Frechet distance: 3,200 frames.
const BATCH: usize = 8;
/// Distance within which a keypoint is correct, metres.
pub const CORRECT: f64 = 0.1;

/// One motion in one window, measured.
#[derive(Debug, Clone)]
pub(super) struct Measured {
    speaking: bool,
    summary: Summary,
    poses: Moments,
    accelerations: Moments,
    ape: Option<f64>,
    pck: Option<f64>,
    listening: Tally,
    talking: Tally,
    nods: NodTally,
    bones: Option<f64>,
}

impl Measured {
    /// Mean gaze score.
    pub(super) fn head_angle(&self) -> Option<f64> {
        self.summary.head_angle
    }

    /// Measures the motion in `window`.
    pub(super) fn of(rig: &Rig, window: &Window, Played { frames, bones }: Played) -> Result<Self> {
        let average = |values: Vec<f64>| mean(values.into_iter());
        let truth = &window.truth.frames;
        let (ape, pck) = (ape(&frames, truth, Space::Root)?, pck(&frames, truth, CORRECT, Space::Root)?);
        let recording = window.truth.recording(rig, frames);
        let count = recording.frames.len();
        let (agent, user) = (speech(window.truth.agent(), count), speech(window.truth.user(), count));
        let heard: Vec<bool> = agent.iter().zip(&user).map(|(agent, user)| *user && !agent).collect();
        let (mut listening, mut talking, mut nods) = (Tally::default(), Tally::default(), NodTally::default());
        listening.add(rig, &recording.frames, &heard);
        talking.add(rig, &recording.frames, &agent);
        nods.add(rig, &recording.frames, &agent, &user);
        Ok(Self {
            listening,
            talking,
            nods,
            bones,
            speaking: window.speaking,
            summary: Summary::of(&recording),
            poses: pose_moments(&recording.frames),
            accelerations: acceleration_moments(&recording.frames),
            ape: average(ape),
            pck: average(pck),
        })
    }
}

/// Means over windows; `None` where nothing could be measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Windows.
    pub windows: usize,
    /// Frechet distance of poses to the corpus', m²: over all windows the mean over batches of 8
    /// windows, over a class of windows that of the pooled class (SARAH 4).
    pub fgd: Option<f64>,
    /// Over all windows: the distance of each batch, whose mean is [`Figures::fgd`]. What two
    /// bundles' batches differ by tells how sure the difference of their means is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fgd_batches: Vec<f64>,
    /// Frechet distance of accelerations, (m/s²)², likewise.
    pub fgd_acceleration: Option<f64>,
    /// Share of frames with a sliding foot, 0 to 1.
    pub foot_slide: Option<f64>,
    /// Horizontal speed of the lower foot, m/s.
    pub support_foot_speed: Option<f64>,
    /// Mean wrist speed ("wrist var"), m/s.
    pub wrist_speed: Option<f64>,
    /// Mean gaze score ("head angle"), -1 to 1.
    pub head_angle: Option<f64>,
    /// Acceleration at borders of blocks over that inside.
    pub seam: Option<f64>,
    /// Correlation of the agent's voice with wrist speed, over windows in which the agent speaks.
    pub beat: Option<f64>,
    /// The same with the voice shuffled.
    pub beat_shuffled: Option<f64>,
    /// Average position error against the corpus' motion in the root's frame, metres (DRAM eq. 10).
    pub ape: Option<f64>,
    /// Share of keypoints within 10 cm of the corpus', 0 to 1 (DRAM eq. 11).
    pub pck: Option<f64>,
    /// Mean deviation of bone lengths before the fit, relative.
    pub bone_deviation: Option<f64>,
    /// Mean speed of all joints, m/s.
    pub joint_speed: Option<f64>,
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What made the motion.
    pub name: String,
    /// The gaze target that was asked for.
    pub gaze_target: Option<f32>,
    /// Whether sessions of the bundle made it.
    pub model: bool,
    /// Over all windows.
    pub all: Figures,
    /// Over the windows in which the agent speaks at least half of the time.
    pub speaking: Figures,
    /// Over the others.
    pub non_speaking: Figures,
    /// Wrist speed in frames in which the agent speaks over that in the others, in windows that
    /// have both.
    pub wrist_ratio: Option<f64>,
    /// How lively the agent is while the user speaks alone.
    pub listens: Liveliness,
    /// How lively it is while it speaks.
    pub talks: Liveliness,
    /// Its nods as a listener.
    pub nods: Nods,
}

impl Row {
    /// The same, made by sessions of the bundle.
    pub(super) fn by_model(self) -> Self {
        Self { model: true, ..self }
    }

    pub(super) fn new(name: String, gaze_target: Option<f32>, motion: &[Measured], truth: &[Measured]) -> Self {
        let figures = |class: Option<bool>| Figures::new(motion, truth, class);
        Self {
            name,
            gaze_target,
            model: false,
            all: figures(None),
            speaking: figures(Some(true)),
            non_speaking: figures(Some(false)),
            wrist_ratio: wrist_ratio(motion),
            listens: tally(motion, |m| &m.listening).row(),
            talks: tally(motion, |m| &m.talking).row(),
            nods: nods(motion).row(),
        }
    }
}

impl Figures {
    /// Of the windows of a class, or of all.
    fn new(motion: &[Measured], truth: &[Measured], class: Option<bool>) -> Self {
        let chosen = |m: &&Measured| class.is_none_or(|speaking| m.speaking == speaking);
        let own: Vec<&Measured> = motion.iter().filter(chosen).collect();
        let true_ones: Vec<&Measured> = truth.iter().filter(chosen).collect();
        let average = |value: &dyn Fn(&Measured) -> Option<f64>| mean(own.iter().filter_map(|m| value(m)));
        let batches = |moments: &dyn Fn(&Measured) -> &Moments| -> Option<Vec<f64>> {
            let size = if class.is_none() { BATCH } else { own.len().max(1) };
            let pairs = own.chunks(size).zip(true_ones.chunks(size));
            pairs.map(|(a, b)| frechet(&pooled(a, moments), &pooled(b, moments))).collect()
        };
        let poses = batches(&|m| &m.poses);
        let beat = |m: &Measured| m.summary.beat.filter(|_| m.speaking);
        Self {
            windows: own.len(),
            fgd: poses.as_ref().and_then(|d| mean(d.iter().copied())),
            fgd_batches: poses.filter(|_| class.is_none()).unwrap_or_default(),
            fgd_acceleration: batches(&|m| &m.accelerations).and_then(|d| mean(d.into_iter())),
            foot_slide: average(&|m| m.summary.foot_slide),
            support_foot_speed: average(&|m| m.summary.support_foot_speed),
            wrist_speed: average(&|m| m.summary.wrist_speed),
            head_angle: average(&|m| m.summary.head_angle),
            seam: average(&|m| m.summary.seam),
            beat: average(&|m| Some(beat(m)?.correlation)),
            beat_shuffled: average(&|m| Some(beat(m)?.shuffled)),
            ape: average(&|m| m.ape),
            pck: average(&|m| m.pck),
            bone_deviation: average(&|m| m.bones),
            joint_speed: average(&|m| Some(m.summary.joint_speed?.mean)),
        }
    }
}

fn pooled(windows: &[&Measured], moments: &dyn Fn(&Measured) -> &Moments) -> Moments {
    let dim = windows.first().map_or(0, |m| moments(m).dim());
    windows.iter().fold(Moments::new(dim), |mut all, m| {
        all.merge(moments(m));
        all
    })
}

fn tally(motion: &[Measured], part: impl Fn(&Measured) -> &Tally) -> Tally {
    Tally::sum(motion.iter().map(|m| part(m).clone()))
}

fn nods(motion: &[Measured]) -> NodTally {
    motion.iter().fold(NodTally::default(), |mut all, m| {
        all.merge(m.nods.clone());
        all
    })
}

fn wrist_ratio(motion: &[Measured]) -> Option<f64> {
    let both = || motion.iter().filter_map(|m| Some((m.summary.speaking?, m.summary.non_speaking?)));
    let speed = |split: Split| Some((split.share, split.wrist_speed?));
    let weighted = |splits: &mut dyn Iterator<Item = Split>| {
        let (weight, sum) = splits.filter_map(speed).fold((0.0, 0.0), |(w, s), (share, v)| (w + share, s + share * v));
        (weight > 0.0).then(|| sum / weight)
    };
    let silent = weighted(&mut both().map(|(_, silent)| silent)).filter(|v| *v > 0.0)?;
    Some(weighted(&mut both().map(|(speaking, _)| speaking))? / silent)
}

/// Mean of all values, if there are any.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0_usize, 0.0), |(n, sum), v| (n + 1, sum + v));
    (count > 0).then(|| sum / count as f64)
}

/// The middle of all values; of an even number the higher of the two.
pub(super) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}
