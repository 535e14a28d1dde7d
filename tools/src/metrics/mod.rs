//! What a motion is worth, in numbers: feet, wrists, gaze, seams, beat, distributions and
//! distances.
//!
//! Every function is pure and reads frames (or a whole [`Recording`](crate::recording::Recording)).
//! Positions are the *decoded* joint positions ([`Frame::global`](visavis::Frame::global)), not the
//! fixed-bone-length rig's, so that nothing is prettified ([`crate::eval`] makes them the rig's
//! first: there motion is compared with others', as it is played). Units are metres, seconds and radians. A
//! metric that has nothing to measure (too few frames, a joint the rig lacks, no voice, no user) is
//! `None`, never a synthetic zero.
//!
//! | metric | function | source |
//! |---|---|---|
//! | FGD, FGD_acc | [`pose_moments`], [`acceleration_moments`], [`frechet`] | SARAH 4 |
//! | foot slide | [`foot_slide`] | SARAH 4 |
//! | support-foot speed | [`support_foot_speed`] | ours |
//! | wrist var | [`wrist_speed`] | SARAH 4 |
//! | head angle | [`head_angle`], [`gaze_score`] | SARAH 3.4, 4 |
//! | seam | [`seam`], [`switch_seam`] | ours |
//! | beat | [`beat`] | ours |
//! | APE, PCK | [`ape`], [`pck`] | DRAM eq. 10, 11 |
//! | bone length deviation | [`bone_deviation`] | ours |
//! | stillness, sway and so on | [`Tally`] | recorded people |
//! | nods | [`NodTally`] | recorded people |
//! | joint speed | [`joint_speed`] | ours |
//! | speaking / non-speaking | [`speech_frames`], [`is_speaking`] | SARAH 4 |

mod beat;
mod bones;
mod dyadic;
mod feet;
mod frechet;
mod gaze;
mod keypoints;
mod linalg;
mod liveliness;
mod moments;
mod nods;
mod seam;
mod speech;
mod speed;
mod summary;
#[cfg(test)]
mod testing;

pub use beat::{Beat, beat};
pub use bones::{BoneDeviation, bone_deviation};
pub use dyadic::Dyadic;
pub use feet::{CONTACT_HEIGHT, SLIDE_SPEED, foot_clearances, foot_slide, support_foot_speed};
pub use frechet::frechet;
pub use gaze::{gaze_score, gaze_scores, head_angle};
pub use keypoints::{Space, ape, pck};
pub use liveliness::{BANDS, Liveliness, Tally};
pub use moments::{Moments, acceleration_moments, pose_moments};
pub use nods::{NodTally, Nods};
pub use seam::{seam, switch_seam};
pub use speech::{envelope, is_speaking, speech_frames};
pub use speed::{JointSpeed, joint_speed, wrist_speed, wrist_speeds};
pub use summary::{Split, Summary};

use glam::Vec3;
use visavis::{FPS, Frame, Rig};

/// Frames a second, as the factor that turns m/frame into m/s.
const RATE: f64 = FPS as f64;

/// Index of a joint by its VRM humanoid name.
fn joint(rig: &Rig, name: &str) -> Option<usize> {
    rig.joints.iter().position(|j| j.name == name)
}

/// Decoded world position of joint `j`.
fn position(frame: &Frame, j: usize) -> Vec3 {
    frame.global[j].position
}

/// Arithmetic mean, `None` of nothing.
fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.into_iter().fold((0.0, 0_usize), |(sum, n), v| (sum + v, n + 1));
    (n > 0).then(|| sum / n as f64)
}

/// Arithmetic mean of two values or more, and the square of its standard error: variance (n - 1)
/// over n.
pub(crate) fn mean_and_error2(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
    (mean, square / (n - 1.0) / n)
}
