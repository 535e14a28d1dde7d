//! All metrics that need no ground truth, for `metrics.json`.

use super::dyadic::Dyadic;
use super::*;
use crate::recording::Recording;
use serde::Serialize;

/// Metrics of one recording. What could not be measured is `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Frames measured.
    pub frames: usize,
    /// Length, seconds.
    pub seconds: f64,
    /// Share of frames with a foot sliding, 0 to 1 ([`foot_slide`]).
    pub foot_slide: Option<f64>,
    /// Mean horizontal speed of the lower foot, m/s ([`support_foot_speed`]).
    pub support_foot_speed: Option<f64>,
    /// Mean wrist speed, m/s ([`wrist_speed`]).
    pub wrist_speed: Option<f64>,
    /// The same in mm/s, comparable with SARAH's "wrist var".
    pub wrist_var: Option<f64>,
    /// Mean gaze score, -1 to 1 ([`head_angle`]).
    pub head_angle: Option<f64>,
    /// The gaze score that was asked for, 0 to 1.
    pub gaze_target: Option<f64>,
    /// Acceleration across block boundaries over inside blocks ([`seam`]).
    pub seam: Option<f64>,
    /// Wrists and voice ([`beat`]).
    pub beat: Option<Beat>,
    /// Bone lengths against the rig's, relative ([`bone_deviation`]).
    pub bone_deviation: Option<BoneDeviation>,
    /// Speed of all joints, m/s ([`joint_speed`]).
    pub joint_speed: Option<JointSpeed>,
    /// Largest distance between a decoded joint and the fixed-bone-length rig's, over all frames,
    /// metres.
    pub max_fit_error: Option<f64>,
    /// Whom the body follows; of bundles that tell ([`visavis::Frame::dyadic`]).
    pub dyadic: Option<Dyadic>,
    /// Frames in which the agent speaks; `None` without an agent voice.
    pub speaking: Option<Split>,
    /// Frames in which it does not.
    pub non_speaking: Option<Split>,
}

/// Metrics over the frames of one class.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Split {
    /// Share of the recording's frames, 0 to 1.
    pub share: f64,
    /// Mean wrist speed, m/s.
    pub wrist_speed: Option<f64>,
    /// Mean gaze score, -1 to 1.
    pub head_angle: Option<f64>,
}

impl Summary {
    /// Measures a recording.
    pub fn of(recording: &Recording) -> Self {
        let (rig, frames) = (&recording.rig, recording.frames.as_slice());
        let wrist_speed = wrist_speed(rig, frames);
        let speech = recording.agent_voice.as_deref().map(|voice| speech_frames(voice, frames.len()));
        let split = |speaking: bool| speech.as_deref().and_then(|speech| Split::of(recording, speech, speaking));
        Self {
            frames: frames.len(),
            seconds: frames.len() as f64 / RATE,
            foot_slide: foot_slide(rig, frames),
            support_foot_speed: support_foot_speed(rig, frames),
            wrist_speed,
            wrist_var: wrist_speed.map(|v| 1000.0 * v),
            head_angle: head_angle(recording),
            gaze_target: recording.gaze_target.map(f64::from),
            seam: seam(frames),
            beat: beat(recording),
            bone_deviation: bone_deviation(rig, frames),
            joint_speed: joint_speed(frames),
            max_fit_error: frames.iter().map(|f| f64::from(f.fit_error)).reduce(f64::max),
            dyadic: Dyadic::of(recording),
            speaking: split(true),
            non_speaking: split(false),
        }
    }

    /// Pretty-printed JSON with a final newline, the content of `metrics.json`.
    pub fn to_json(&self) -> String {
        // Only maps with keys that are no strings and failing writers make this fail; there is
        // neither.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}

impl Split {
    /// Metrics over the frames whose `speech` equals `speaking`; `None` when there is none.
    fn of(recording: &Recording, speech: &[bool], speaking: bool) -> Option<Self> {
        let chosen = |i: usize| speech[i] == speaking;
        let share = mean((0..speech.len()).map(|i| f64::from(u8::from(chosen(i)))))?;
        let gaze = gaze_scores(recording);
        let speeds = wrist_speeds(&recording.rig, &recording.frames).unwrap_or_default();
        (share > 0.0).then(|| Self {
            share,
            // speeds[i] leads to frame i + 1.
            wrist_speed: mean(speeds.iter().enumerate().filter(|(i, _)| chosen(i + 1)).map(|(_, &v)| v)),
            head_angle: mean(gaze.iter().enumerate().filter(|(i, _)| chosen(*i)).filter_map(|(_, &g)| g)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;
    use glam::Vec3;

    /// Two seconds of gesturing speech at 0.6 m/s, then two of silent rest; the user straight
    /// ahead.
    fn conversation() -> Recording {
        let mut r = recording(120, |i, _, p| (2..4).for_each(|j| p[j].y += i.min(60) as f32 * 0.02));
        r.agent_voice = Some((0..120 * 800).map(|i| if i < 48_000 { (i as f32).sin() } else { 0.0 }).collect());
        r.user.fill(Some(Vec3::new(0.0, 1.6, 2.0)));
        r.gaze_target = Some(0.5);
        r
    }

    #[test]
    fn splits_by_the_agents_voice() {
        let summary = Summary::of(&conversation());
        let (speaking, quiet) = (summary.speaking.unwrap(), summary.non_speaking.unwrap());
        // 60 loud frames and the hangover of 6.
        close(speaking.share, 66.0 / 120.0, 1e-9);
        close(speaking.share + quiet.share, 1.0, 1e-9);
        close(speaking.wrist_speed.unwrap(), 0.6 * 60.0 / 65.0, 1e-4);
        close(quiet.wrist_speed.unwrap(), 0.0, 1e-9);
        close(quiet.head_angle.unwrap(), 1.0, 1e-6);
        close(summary.wrist_var.unwrap(), 1000.0 * 0.6 * 60.0 / 119.0, 0.1);
    }

    #[test]
    fn json_has_every_field_and_null_for_the_unknown() {
        let mut r = conversation();
        (r.agent_voice, r.gaze_target) = (None, None);
        r.user.fill(None);
        let json: serde_json::Value = serde_json::from_str(&Summary::of(&r).to_json()).unwrap();
        assert_eq!(json["frames"], 120);
        assert_eq!(json["foot_slide"], 0.0);
        for field in ["head_angle", "gaze_target", "beat", "dyadic", "speaking", "non_speaking"] {
            assert!(json.as_object().unwrap().contains_key(field) && json[field].is_null(), "{field}");
        }
    }

    #[test]
    fn an_empty_recording_measures_nothing() {
        let mut r = recording(0, |_, _, _| {});
        r.agent_voice = Some(Vec::new());
        let summary = Summary::of(&r);
        assert_eq!((summary.frames, summary.wrist_speed, summary.speaking), (0, None, None));
        assert_eq!(summary.max_fit_error, None);
    }
}
