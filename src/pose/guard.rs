//! Plausibility: what no human body can do is not shown.
//!
//! A bundle may be damaged, a weight may have been flipped, arithmetic may overflow: the decoder
//! then gives numbers that are not finite, or joints that fly. The guard stands between the decoded
//! pose and what is made of it. Where a frame is not plausible it goes on from the last frames it
//! showed, eased into a held, breathing pose, and comes back in a cross-fade when four plausible
//! frames have followed each other. A session that must pause is held by the same means.
//!
//! | bound | value | why |
//! |---|---|---|
//! | [`MAX_JOINT_SPEED`] | 12 m/s, as seen from the body | an Olympic boxer's fist: 9.1 m/s, standard deviation 2.1 (Walilko, Viano and Bir 2005) |
//! | [`MAX_ROOT_SPEED`] | 11 m/s | a sprinter's record: 12.4 m/s; what [`super::Decoder`] corrects for planted feet comes on top, 0.8 m/s at most |
//! | [`MAX_TURN_SPEED`] | 15 rad/s | more than two turns per second |
//! | reach | 1.5 x the rig's longest chain of bones | from the point below the hips |

use super::Rig;
use crate::frame::{FPS, Transform};
use glam::Quat;

/// No joint moves faster than this as seen from the body, m/s.
pub const MAX_JOINT_SPEED: f32 = 12.0;
/// The body moves no faster than this, m/s.
pub const MAX_ROOT_SPEED: f32 = 11.0;
/// The body turns no faster than this, rad/s.
pub const MAX_TURN_SPEED: f32 = 15.0;

/// A bundle that trips the guard more often than this is defective, trips a minute of motion.
pub const DEFECTIVE_TRIPS_A_MINUTE: f64 = 1.0;
/// A bundle is defective as well when more than this part of its motion is held: one that is never
/// plausible trips once and stays held. A trip holds 12 frames at least, 0.7 % of a minute.
pub const DEFECTIVE_HELD: f64 = 0.02;

/// Frames of a cross-fade back to decoded poses.
const FADE: u32 = 8;
/// Plausible frames in a row after which it comes back, a block.
const GOOD: u32 = 4;
/// What is left of a speed from one held frame to the next: half after two frames.
const EASE: f32 = 0.7;
/// Motion that is held goes on no faster than this, m/frame.
const EASE_SPEED: f32 = 2.0 / FPS as f32;
/// Pitch of the chest in a breath, radians: 4 mm at the height of the head.
const BREATH: f32 = 0.012;
/// Frames of a breath, 15 per minute.
const BREATH_FRAMES: u32 = 4 * FPS;

/// What the guard met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GuardStats {
    /// Times it took over from plausible motion.
    pub trips: u64,
    /// Frames with a number that is not finite, or without any.
    pub non_finite: u64,
    /// Frames with a joint that was too fast or out of reach.
    pub joints: u64,
    /// Frames in which the body moved or turned too fast.
    pub root: u64,
    /// Frames shown that were held, or faded back, because of that.
    pub held_frames: u64,
}

impl GuardStats {
    /// Whether `frames` frames of motion that were guarded like this come from a defective bundle.
    /// One trip is forgiven.
    pub fn is_defective(&self, frames: u64) -> bool {
        let minutes = frames as f64 / (60.0 * f64::from(FPS));
        self.trips as f64 > (DEFECTIVE_TRIPS_A_MINUTE * minutes).max(1.0)
            || self.held_frames as f64 > DEFECTIVE_HELD * (frames as f64).max(60.0 * f64::from(FPS))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Follow,
    Hold,
    /// Frames of the cross-fade that are left.
    Fade(u32),
}

/// What a frame is like.
#[derive(Debug, Clone, Copy)]
struct Verdict {
    /// There are numbers, and all are finite.
    finite: bool,
    /// The joints are within reach and go on from where they were.
    plausible: bool,
    /// The root neither jumps nor spins.
    steady: bool,
}

/// Judges poses and replaces them where they are not plausible. Streaming; allocates nothing once
/// made.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    reach: f32,
    /// The joint that breathes and those that it carries; the joint that keeps the head still and
    /// those that it carries.
    chest: Option<(usize, Vec<bool>)>,
    neck: Option<(usize, Vec<bool>)>,
    state: State,
    /// Whether it holds, or fades back, because it was asked to.
    paused: bool,
    /// Shown last, in its heading frame, without the breath, and how it changed from the frame
    /// before.
    shown: Vec<Transform>,
    speed: Vec<Transform>,
    step: [f32; 3],
    /// Decoded last, when that was plausible.
    decoded: Vec<Transform>,
    known: bool,
    /// Plausible frames in a row, each next to the one before.
    good: u32,
    breath: u32,
    stats: GuardStats,
}

impl Guard {
    pub(super) fn new(rig: &Rig) -> Self {
        let n = rig.len();
        let chain = |j: usize| std::iter::successors(Some(j), |&j| rig.joints[j].parent);
        let reach = (0..n).map(|j| chain(j).map(|j| rig.offset(j).length()).sum::<f32>()).fold(0.0, f32::max);
        let subtree = |names: &[&str]| {
            let top = names.iter().find_map(|name| rig.index(name))?;
            Some((top, (0..n).map(|j| chain(j).any(|j| j == top)).collect()))
        };
        let mut rest = vec![Transform::IDENTITY; n];
        rig.fk(rig.offset(0), &vec![Quat::IDENTITY; n], &mut rest);
        Self {
            reach: 1.5 * reach,
            chest: subtree(&["upperChest", "chest", "spine"]),
            neck: subtree(&["neck", "head"]),
            state: State::Follow,
            paused: false,
            speed: vec![Transform::IDENTITY; n],
            decoded: rest.clone(),
            shown: rest,
            step: [0.0; 3],
            known: false,
            good: 0,
            breath: 0,
            stats: GuardStats::default(),
        }
    }

    /// Starts again with the pose that was shown last, if there was one.
    pub(super) fn reset(&mut self) {
        (self.state, self.paused) = (State::Follow, false);
        self.speed.fill(Transform::IDENTITY);
        (self.step, self.known, self.good, self.breath) = ([0.0; 3], false, 0, 0);
        self.stats = GuardStats::default();
    }

    /// Takes `joints` for the pose before the first frame, if it is plausible.
    pub(super) fn prime(&mut self, joints: &[Transform]) {
        if joints.iter().all(|j| self.near(j)) {
            self.shown.copy_from_slice(joints);
        }
    }

    pub(super) fn stats(&self) -> GuardStats {
        self.stats
    }

    /// Judges the next frame: `joints` in its heading frame and the root's `step` to it; replaces
    /// them where that is needed. Returns how much of the frame is held, 0 to 1.
    pub(super) fn check(&mut self, joints: &mut [Transform], step: &mut [f32; 3]) -> f32 {
        let verdict = self.judge(joints, *step);
        self.answer(verdict, joints, step)
    }

    /// The next frame, of which nothing usable is known; what `joints` and `step` hold is not
    /// looked at.
    pub(super) fn miss(&mut self, joints: &mut [Transform], step: &mut [f32; 3]) -> f32 {
        self.answer(Verdict { finite: false, plausible: false, steady: false }, joints, step)
    }

    fn judge(&self, joints: &[Transform], step: [f32; 3]) -> Verdict {
        let finite = joints.iter().all(finite) && step.iter().all(|v| v.is_finite());
        let fast = MAX_JOINT_SPEED / FPS as f32;
        let plausible = finite && {
            let slow = |(now, before): (&Transform, &Transform)| now.position.distance(before.position) <= fast;
            joints.iter().all(|j| self.near(j)) && (!self.known || joints.iter().zip(&self.decoded).all(slow))
        };
        let [vx, vz, dyaw] = step;
        let steady =
            finite && libm::hypotf(vx, vz) <= MAX_ROOT_SPEED / FPS as f32 && dyaw.abs() <= MAX_TURN_SPEED / FPS as f32;
        Verdict { finite, plausible, steady }
    }

    /// Replaces the frame where its verdict says so; returns how much of it is held.
    fn answer(&mut self, verdict: Verdict, joints: &mut [Transform], step: &mut [f32; 3]) -> f32 {
        let Verdict { finite, plausible, steady } = verdict;
        self.stats.non_finite += u64::from(!finite);
        self.stats.joints += u64::from(finite && !plausible);
        self.stats.root += u64::from(finite && !steady);

        let before = self.state;
        self.good = if plausible && (self.known || self.good > 0) { self.good + 1 } else { 0 };
        self.state = match before {
            State::Follow if !plausible => {
                self.stats.trips += 1;
                State::Hold
            }
            State::Follow => {
                self.stats.trips += u64::from(!steady);
                State::Follow
            }
            State::Hold if self.good >= if self.paused { 1 } else { GOOD } => State::Fade(FADE),
            State::Fade(_) if !plausible => State::Hold,
            State::Fade(1) => State::Follow,
            State::Fade(left) => State::Fade(left - 1),
            State::Hold => State::Hold,
        };
        if self.state == State::Follow && before != State::Follow {
            self.shown.copy_from_slice(&self.decoded);
        }
        self.known = finite && joints.iter().all(|j| self.near(j));
        if self.known {
            self.decoded.copy_from_slice(joints);
        }
        let own = match self.state {
            State::Follow => 1.0,
            State::Hold => 0.0,
            State::Fade(left) => {
                let t = (FADE + 1 - left) as f32 / (FADE + 1) as f32;
                t * t * (3.0 - 2.0 * t)
            }
        };
        let held = if own == 1.0 {
            if !steady {
                *step = self.step.map(|v| v * EASE);
            }
            self.remember(joints, *step);
            f32::from(u8::from(!steady))
        } else {
            self.ease();
            // What is not plausible is not even mixed in with weight 0: it may be NaN.
            for (joint, still) in joints.iter_mut().zip(&self.shown) {
                *joint = if own > 0.0 { mix(still, joint, own) } else { *still };
            }
            let (from, to) = (self.step, *step);
            *step = if own > 0.0 && steady { [0, 1, 2].map(|c| from[c] + own * (to[c] - from[c])) } else { from };
            self.breathe(joints, 1.0 - own);
            1.0 - own
        };
        self.paused &= self.state != State::Follow;
        self.stats.held_frames += u64::from(held > 0.0 && !self.paused);
        held
    }

    /// The next frame without a decoded one: eased on from the last.
    pub(super) fn hold(&mut self, joints: &mut [Transform], step: &mut [f32; 3]) {
        (self.state, self.paused, self.good) = (State::Hold, true, 0);
        // Decoding goes on where it stopped; the way back is a fade all the same.
        self.ease();
        joints.copy_from_slice(&self.shown);
        *step = self.step;
        self.breathe(joints, 1.0);
    }

    /// Comes over to what is decoded next as after a hold, wherever that is.
    pub(super) fn cross_fade(&mut self) {
        (self.state, self.paused, self.good, self.known) = (State::Hold, true, 0, false);
    }

    /// Whether a joint is finite and within reach.
    fn near(&self, joint: &Transform) -> bool {
        finite(joint) && joint.position.length() <= self.reach
    }

    fn remember(&mut self, joints: &[Transform], step: [f32; 3]) {
        for ((speed, shown), joint) in self.speed.iter_mut().zip(&mut self.shown).zip(joints) {
            let moved = (joint.position - shown.position).clamp_length_max(EASE_SPEED);
            let turned = joint.rotation * shown.rotation.inverse();
            let turned = if turned.w < 0.0 { -turned } else { turned };
            // Half a radian a frame is more than what eases out within a body's range.
            let turned = if turned.w < 0.97 { Quat::IDENTITY } else { turned };
            *speed = Transform { position: moved, rotation: turned };
            *shown = *joint;
        }
        (self.step, self.breath) = (step, 0);
    }

    /// One frame on, slower than the last.
    fn ease(&mut self) {
        for (speed, shown) in self.speed.iter_mut().zip(&mut self.shown) {
            speed.position *= EASE;
            speed.rotation = Quat::IDENTITY.lerp(speed.rotation, EASE);
            shown.position += speed.position;
            shown.rotation = (speed.rotation * shown.rotation).normalize();
        }
        self.step = self.step.map(|v| v * EASE);
        self.breath += 1;
    }

    /// The chest pitches forth and back, the head stays upright; `depth` 0 to 1.
    fn breathe(&self, joints: &mut [Transform], depth: f32) {
        let phase = std::f64::consts::TAU * f64::from(self.breath % BREATH_FRAMES) / f64::from(BREATH_FRAMES);
        let half = 0.5 * depth * BREATH * libm::sin(phase) as f32;
        for (part, half) in [(&self.chest, -half), (&self.neck, half)] {
            let Some((top, carried)) = part else { continue };
            // The sine of so small an angle is the angle.
            let turn = Quat::from_xyzw(half, 0.0, 0.0, 1.0).normalize();
            let at = joints[*top].position;
            for (joint, _) in joints.iter_mut().zip(carried).filter(|(_, carried)| **carried) {
                joint.position = at + turn * (joint.position - at);
                joint.rotation = (turn * joint.rotation).normalize();
            }
        }
    }
}

fn finite(joint: &Transform) -> bool {
    joint.position.is_finite() && joint.rotation.is_finite()
}

/// From `a` (0) to `b` (1).
fn mix(a: &Transform, b: &Transform, part: f32) -> Transform {
    Transform { position: a.position.lerp(b.position, part), rotation: a.rotation.lerp(b.rotation, part) }
}

#[cfg(test)]
#[path = "guard_tests.rs"]
mod tests;
