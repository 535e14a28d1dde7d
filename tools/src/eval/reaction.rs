//! How long the head takes to find a user who is suddenly somewhere else.

use super::clip::{Clip, Segment};
use super::figures::median;
use super::motion::generate;
use super::parallel::each;
use super::window::Window;
use crate::metrics::head_angle;
use glam::{Vec2, Vec3};
use serde::Serialize;
use std::sync::Arc;
use visavis::{Engine, FPS, Frame, Result, Rig, Root, SessionOptions};

/// The head has found the user when it points within this angle of it on the floor, degrees.
pub const FOUND: f64 = 20.0;
/// Longest time that is waited, seconds; who has not found the user by then counts as this.
pub const PATIENCE: f64 = 3.0;
/// A change of bearing within a frame that counts as a jump, degrees.
const JUMP: f64 = 60.0;
/// In the second before, the corpus' agent looked at the user within this angle, degrees (median).
const ENGAGED: f64 = 30.0;
/// Seconds before a jump that a session is given.
const BEFORE: usize = 6 * FPS as usize;
const AFTER: usize = (PATIENCE * FPS as f64) as usize;
/// Most jumps of each kind.
const MOST: usize = 32;

/// Reaction times, seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reaction {
    /// Jumps in the clips while the corpus' agent looked at the user.
    pub jumps: usize,
    /// Median time of the corpus' agent.
    pub truth: Option<f64>,
    /// Median time of the model at the same jumps.
    pub model: Option<f64>,
    /// Staged jumps: the user stands 1.5 m ahead for five seconds, then 90 degrees to a side.
    pub staged_jumps: usize,
    /// Median time of the model there.
    pub staged: Option<f64>,
}

/// A jump in a clip: six seconds that lead to it and three after it.
struct Event {
    segment: Segment,
    /// Gaze score of the corpus' agent in those six seconds. Sessions are asked for the same: left
    /// free, some would be of agents who avoid the user's eyes, and those are not looked for here.
    gaze: Option<f32>,
}

impl Reaction {
    /// Measures the corpus' agent and the model over jumps in `clips`, and the model over staged
    /// ones with the voices of `windows`; `quick`: four of each at most.
    pub(super) fn measure(
        engine: &Arc<Engine>,
        options: &SessionOptions,
        clips: &[Clip],
        windows: &[Window],
        threads: usize,
        quick: bool,
    ) -> Result<Self> {
        let rig = &engine.config().rig;
        let most = if quick { 4 } else { MOST };
        let events = events(rig, clips, most)?;
        let time = |frames: &[Frame], user: &[Vec3]| time(rig, &frames[BEFORE..], &user[BEFORE..]);
        let truth: Vec<f64> = events.iter().map(|e| time(&e.segment.frames, &e.segment.user)).collect();
        let model = each(threads, events.len(), &|_| {}, &|i| {
            let Event { segment, gaze } = &events[i];
            let Segment { frames, user, user_rotation, .. } = segment;
            let options = SessionOptions { start: frames[0].root, seed: i as u64, gaze: *gaze, ..options.clone() };
            let voices = [segment.agent(), segment.user()];
            let motion = generate(engine, options, voices, user.iter().copied(), user_rotation.as_deref())?;
            Ok(time(&motion.recording.frames, user))
        })?;
        let staged_jumps = most.min(2 * windows.len());
        let staged = each(threads, staged_jumps, &|_| {}, &|i| {
            let side = if i % 2 == 0 { 1.5 } else { -1.5 };
            let place = |f: usize| if f < BEFORE { Vec3::new(0.0, 1.65, 1.5) } else { Vec3::new(side, 1.65, 0.0) };
            let user: Vec<Vec3> = (0..BEFORE + AFTER).map(place).collect();
            let part = windows[i / 2].segment.cut(0, BEFORE + AFTER);
            let options = SessionOptions { start: Root::default(), seed: 1000 + i as u64, ..options.clone() };
            let motion = generate(engine, options, [part.agent(), part.user()], user.iter().copied(), None)?;
            Ok(time(&motion.recording.frames, &user))
        })?;
        Ok(Self {
            jumps: events.len(),
            truth: median(&truth),
            model: median(&model),
            staged_jumps,
            staged: median(&staged),
        })
    }
}

/// Jumps of the user while the corpus' agent looks at them, spread over the clips.
fn events(rig: &Rig, clips: &[Clip], most: usize) -> Result<Vec<Event>> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (c, clip) in clips.iter().enumerate() {
        let all = clip.read(0, clip.frames())?;
        let bearing = |agent: usize, user: usize| {
            let p = all.frames[agent].root.to_local(all.user[user]);
            Vec2::new(p.x, p.z)
        };
        let jumps: Vec<usize> = (1..clip.frames())
            .filter(|&i| degrees(bearing(i, i - 1), bearing(i, i)).is_some_and(|a| a >= JUMP))
            .collect();
        for (n, &i) in jumps.iter().enumerate() {
            let alone = jumps.get(n + 1).is_none_or(|&next| next >= i + AFTER);
            if i < BEFORE || i + AFTER > clip.frames() || !alone {
                continue;
            }
            let looks = |f: usize| angle(rig, &all.frames[f], all.user[f]).unwrap_or(180.0);
            let before: Vec<f64> = (i - FPS as usize..i).map(looks).collect();
            if median(&before).is_some_and(|a| a <= ENGAGED) {
                found.push((c, i));
            }
        }
    }
    let count = found.len().min(most);
    let chosen = (0..count).map(|k| found[(2 * k + 1) * found.len() / (2 * count)]);
    let event = |(c, i): (usize, usize)| {
        let segment = clips[c].read(i - BEFORE, BEFORE + AFTER)?;
        let before = segment.cut(0, BEFORE);
        let score = head_angle(&before.recording(rig, before.frames.clone()));
        Ok(Event { segment, gaze: score.map(|score| score.clamp(0.0, 1.0) as f32) })
    };
    chosen.map(event).collect()
}

/// Seconds from the first frame until the head has found the user.
fn time(rig: &Rig, frames: &[Frame], user: &[Vec3]) -> f64 {
    let found = frames.iter().zip(user).position(|(f, u)| angle(rig, f, *u).is_some_and(|a| a <= FOUND));
    found.map_or(PATIENCE, |i| i as f64 / f64::from(FPS)).min(PATIENCE)
}

/// Angle on the floor between where the head points and where the user is, degrees.
fn angle(rig: &Rig, frame: &Frame, user: Vec3) -> Option<f64> {
    let (front, back) = rig.head_points(&frame.global[rig.index("head")?]);
    let floor = |v: Vec3| Vec2::new(v.x, v.z);
    degrees(floor(front - back), floor(user - back))
}

fn degrees(a: Vec2, b: Vec2) -> Option<f64> {
    let (a, b) = (a.try_normalize()?, b.try_normalize()?);
    Some(f64::from(a.dot(b).clamp(-1.0, 1.0)).acos().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic;

    #[test]
    fn a_head_that_turns_is_timed() {
        let rig = Rig::humanoid();
        let mut frames = synthetic::walk(90).frames;
        let head = rig.index("head").unwrap();
        let user = vec![Vec3::new(50.0, 1.6, 0.0); 90];
        for (i, frame) in frames.iter_mut().enumerate() {
            // From ahead to the right by 3 degrees a frame: within 20 of a right angle after 70
            // degrees.
            let turn = (3.0 * i as f32).min(90.0).to_radians();
            frame.global[head].position = Vec3::new(0.0, 1.5, 0.0);
            frame.global[head].rotation = glam::Quat::from_rotation_y(turn);
        }
        assert!((time(&rig, &frames, &user) - 24.0 / 30.0).abs() < 1e-9);
        assert_eq!(time(&rig, &frames[..10], &user[..10]), PATIENCE, "not found");
    }
}
