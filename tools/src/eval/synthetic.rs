//! A synthetic test set: a procedural person in a given conversation, for a look at how a bundle
//! does where there are no recordings.

use super::clip::{Clip, Segment};
use crate::metrics::envelope;
use crate::offline::Conversation;
use glam::{Quat, Vec3};
use std::f32::consts::{PI, TAU};
use visavis::internals::pose::{gaze_score, root_of};
use visavis::{FPS, Frame, Rig, Root, Transform};

/// Turn of head and body towards the user, share of what is left in a frame.
const HEAD_RATE: f32 = 0.16;
const BODY_RATE: f32 = 0.04;
/// The body does not follow before the user is this far to the side, radians.
const REACH: f32 = 0.6;

/// Two clips on `rig`: the conversation, and the same with the voices swapped. The agent stands,
/// follows the user with head and body, and lifts its hands with its voice.
///
/// Nobody was recorded and nothing was learnt: figures on it say whether a bundle works, not how
/// good it is.
pub fn synthetic(rig: &Rig, talk: &Conversation) -> Vec<Clip> {
    let voices = [talk.agent(), talk.user()];
    let clip = |name: &str, [agent, user]: [Option<&[f32]>; 2]| {
        Clip::from_segment(name, segment(rig, talk, agent.unwrap_or_default(), user.unwrap_or_default()))
    };
    vec![clip("synthetic", voices), clip("synthetic, voices swapped", [voices[1], voices[0]])]
}

fn segment(rig: &Rig, talk: &Conversation, agent: &[f32], user: &[f32]) -> Segment {
    let count = talk.frames();
    let levels = envelope(agent, count);
    let loud = levels.iter().copied().fold(1e-3, f64::max);
    let mut person = Person::default();
    let mut seen = Vec3::new(0.0, 1.65, 1.5);
    let mut frames = Vec::with_capacity(count);
    let mut users = Vec::with_capacity(count);
    for (i, level) in levels.iter().enumerate() {
        let time = i as f64 / f64::from(FPS);
        seen = talk.path().and_then(|path| path.at(time)).unwrap_or(seen);
        users.push(seen);
        person.step(seen, (level / loud) as f32);
        let mut frame = Frame::empty(rig.len());
        person.pose(rig, time as f32, &mut frame);
        frame.gaze = rig.index("head").and_then(|head| gaze_score(rig, &frame.global[head], seen));
        (frame.index, frame.time) = (i as u64, time);
        frames.push(frame);
    }
    let pcm = |voice: &[f32]| {
        let mut samples: Vec<i16> =
            voice.iter().map(|s| (s * 32767.0).round().clamp(-32768.0, 32767.0) as i16).collect();
        samples.resize(count * visavis::internals::frame::FRAME_SAMPLES, 0);
        Some(samples)
    };
    Segment { frames, user: users, user_rotation: None, agent_voice: pcm(agent), user_voice: pcm(user) }
}

#[derive(Debug, Default)]
struct Person {
    yaw: f32,
    look: f32,
    /// How far the hands are lifted, 0 to 1, and its change a frame.
    lift: f32,
    rise: f32,
}

impl Person {
    fn step(&mut self, user: Vec3, loudness: f32) {
        let wrap = |a: f32| a - TAU * (a / TAU).round();
        let side = wrap(user.x.atan2(user.z) - self.yaw);
        self.yaw += BODY_RATE * (side.abs() - REACH).max(0.0) * side.signum();
        self.look += HEAD_RATE * (side.clamp(-1.2, 1.2) - self.look);
        // A spring pulled up by the voice and down by its weight.
        self.rise += 0.06 * (loudness - self.lift) - 0.35 * self.rise;
        self.lift = (self.lift + self.rise).clamp(0.0, 1.0);
    }

    fn pose(&self, rig: &Rig, t: f32, frame: &mut Frame) {
        let (x, y, z) = (Quat::from_rotation_x, Quat::from_rotation_y, Quat::from_rotation_z);
        let sway = 0.02 * (0.8 * t).sin() + 0.01 * (1.9 * t).sin();
        for (joint, q) in rig.joints.iter().zip(&mut frame.local) {
            let side = if joint.name.starts_with("left") { 1.0 } else { -1.0 };
            let lift = self.lift * (0.8 + 0.2 * (1.3 * t + side).sin());
            *q = match joint.name.trim_start_matches("left").trim_start_matches("right") {
                "spine" => z(sway),
                "chest" => x(0.02 * (1.4 * t).sin()),
                "neck" => y(0.4 * self.look),
                "head" => y(0.6 * self.look) * x(0.04 * (0.7 * t).sin()),
                "UpperArm" => y(-side * 0.4 * lift) * z(-side * (1.27 - 0.15 * lift)),
                "LowerArm" => y(-side * (0.3 + 1.3 * lift)),
                _ => Quat::IDENTITY,
            };
        }
        frame.local[0] = y(self.yaw.rem_euclid(2.0 * PI));
        frame.hips = rig.offset(0);
        frame.global.resize(rig.len(), Transform::IDENTITY);
        rig.fk(frame.hips, &frame.local, &mut frame.global);
        frame.root = root_of(&frame.global[0], Root::default().yaw);
    }
}
