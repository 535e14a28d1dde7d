//! Whom the body follows: how much of each joint is reaction to the user.

use super::{mean, speech_frames};
use crate::recording::Recording;
use serde::Serialize;
use std::collections::BTreeMap;

/// Means of [`visavis::Frame::dyadic`], 0 (the agent's own voice and habit) to 1 (the user).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Dyadic {
    /// Over all joints and frames.
    pub mean: f64,
    /// Over the frames in which the user speaks; `None` without such.
    pub user_speaking: Option<f64>,
    /// Over those in which the user does not.
    pub user_silent: Option<f64>,
    /// Of each joint.
    pub joints: BTreeMap<String, f64>,
}

impl Dyadic {
    /// Of a recording whose frames tell; else `None`.
    pub fn of(recording: &Recording) -> Option<Self> {
        let (joints, frames) = (recording.rig.len(), &recording.frames);
        if frames.is_empty() || frames.iter().any(|frame| frame.dyadic.len() != joints) {
            return None;
        }
        let body: Vec<f64> =
            frames.iter().map(|f| f.dyadic.iter().map(|d| f64::from(*d)).sum::<f64>() / joints as f64).collect();
        let speech = recording.user_voice.as_deref().map(|voice| speech_frames(voice, frames.len()));
        let under = |speaks: bool| {
            let speech = speech.as_deref()?;
            mean(body.iter().zip(speech).filter(|(_, s)| **s == speaks).map(|(d, _)| *d))
        };
        let joint = |j: usize| mean(frames.iter().map(|f| f64::from(f.dyadic[j]))).unwrap_or_default();
        Some(Self {
            mean: mean(body.iter().copied())?,
            user_speaking: under(true),
            user_silent: under(false),
            joints: recording
                .rig
                .joints
                .iter()
                .enumerate()
                .map(|(j, joint_)| (joint_.name.clone(), joint(j)))
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    #[test]
    fn means_by_joint_and_by_who_speaks() {
        let mut r = recording(60, |_, _, _| {});
        assert_eq!(Dyadic::of(&r), None);
        let joints = r.rig.len();
        r.user_voice = Some((0..60 * 800).map(|i| if i < 24_000 { (i as f32).sin() } else { 0.0 }).collect());
        let speech = speech_frames(r.user_voice.as_deref().unwrap(), 60);
        for (frame, speaks) in r.frames.iter_mut().zip(&speech) {
            frame.dyadic = (0..joints)
                .map(|j| {
                    if j == 0 {
                        1.0
                    } else if *speaks {
                        0.5
                    } else {
                        0.0
                    }
                })
                .collect();
        }
        let dyadic = Dyadic::of(&r).unwrap();
        let others = (joints - 1) as f64;
        close(dyadic.user_speaking.unwrap(), (1.0 + 0.5 * others) / joints as f64, 1e-6);
        close(dyadic.user_silent.unwrap(), 1.0 / joints as f64, 1e-6);
        close(dyadic.joints[&r.rig.joints[0].name], 1.0, 1e-9);
        r.frames[7].dyadic.clear();
        assert_eq!(Dyadic::of(&r), None);
    }
}
