//! Metrics over many minutes of frames, in constant memory: measured over half minutes, and
//! averaged.

use crate::metrics::{Summary, foot_slide};
use crate::recording::Recording;
use glam::Vec3;
use serde::Serialize;
use visavis::{FPS, Frame, Rig};

/// Frames that are measured at once.
const PIECE: usize = 30 * FPS as usize;

/// What a window measured; `None` where there was nothing to measure.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Figures {
    /// Share of frames with a sliding foot.
    pub foot_slide: Option<f64>,
    /// Speed of the supporting foot, m/s.
    pub support_foot_speed: Option<f64>,
    /// Mean wrist speed, m/s.
    pub wrist_speed: Option<f64>,
    /// Mean speed of all joints, m/s.
    pub joint_speed: Option<f64>,
    /// Mean gaze score.
    pub head_angle: Option<f64>,
    /// Acceleration across block borders over that inside blocks.
    pub seam: Option<f64>,
    /// Mean relative deviation of bone lengths.
    pub bone_deviation: Option<f64>,
}

impl Figures {
    /// Names and values.
    pub fn all(&self) -> [(&'static str, Option<f64>); 7] {
        [
            ("foot_slide", self.foot_slide),
            ("support_foot_speed", self.support_foot_speed),
            ("wrist_speed", self.wrist_speed),
            ("joint_speed", self.joint_speed),
            ("head_angle", self.head_angle),
            ("seam", self.seam),
            ("bone_deviation", self.bone_deviation),
        ]
    }
}

/// Collects frames and measures them piece by piece. All memory that frames take is taken at the
/// start.
pub(super) struct Window {
    recording: Recording,
    /// Frames that wait for their turn.
    spare: Vec<Frame>,
    sums: [(f64, f64); 7],
}

impl Window {
    pub(super) fn new(rig: &Rig) -> Self {
        let recording = Recording {
            rig: rig.clone(),
            frames: Vec::with_capacity(PIECE + 4),
            user: Vec::with_capacity(PIECE + 4),
            agent_voice: None,
            user_voice: None,
            gaze_target: None,
            sounds: None,
        };
        let spare = (0..PIECE + 4).map(|_| Frame::empty(rig.len())).collect();
        Self { recording, spare, sums: [(0.0, 0.0); 7] }
    }

    pub(super) fn take(&mut self, frames: &[Frame], user: Option<Vec3>) {
        for frame in frames {
            let mut own = self.spare.pop().unwrap_or_else(|| frame.clone());
            own.global.clone_from(&frame.global);
            own.local.clone_from(&frame.local);
            own.dyadic.clone_from(&frame.dyadic);
            let Frame { global, local, dyadic, .. } = own;
            self.recording.frames.push(Frame { global, local, dyadic, ..*frame });
        }
        self.recording.user.resize(self.recording.frames.len(), user);
        if self.recording.frames.len() >= PIECE {
            self.measure();
        }
    }

    fn measure(&mut self) {
        let frames = self.recording.frames.len() as f64;
        if foot_slide(&self.recording.rig, &self.recording.frames).is_some() {
            let s = Summary::of(&self.recording);
            let figures = Figures {
                foot_slide: s.foot_slide,
                support_foot_speed: s.support_foot_speed,
                wrist_speed: s.wrist_speed,
                joint_speed: s.joint_speed.map(|j| j.mean),
                head_angle: s.head_angle,
                seam: s.seam,
                bone_deviation: s.bone_deviation.map(|b| b.mean),
            };
            for ((sum, weight), (_, value)) in self.sums.iter_mut().zip(figures.all()) {
                if let Some(value) = value {
                    (*sum, *weight) = (*sum + frames * value, *weight + frames);
                }
            }
        }
        self.spare.append(&mut self.recording.frames);
        self.recording.user.clear();
    }

    /// Figures of all frames since the last call.
    pub(super) fn finish(&mut self) -> Figures {
        self.measure();
        let sums = std::mem::take(&mut self.sums);
        let mean = |i: usize| {
            let (sum, weight) = sums[i];
            (weight > 0.0).then(|| sum / weight)
        };
        Figures {
            foot_slide: mean(0),
            support_foot_speed: mean(1),
            wrist_speed: mean(2),
            joint_speed: mean(3),
            head_angle: mean(4),
            seam: mean(5),
            bone_deviation: mean(6),
        }
    }
}
