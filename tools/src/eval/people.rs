//! The agent beside real people: at rest with a user who stands and says nothing, listening and
//! speaking.

use super::clip::{Clip, Segment};
use super::motion::generate;
use super::parallel::each;
use super::window::LEAD;
use crate::contents::made_with;
use crate::metrics::{Liveliness, Tally, speech_frames};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use visavis::internals::frame::FRAME_SAMPLES;
use visavis::{Engine, Error, ErrorKind, FPS, Frame, Result, Rig, SessionOptions};

/// Statistics of recorded people, made by `python -m visavis_train.corpus.people` from recordings
/// that are not part of this repository.
const PEOPLE: &str = include_str!("people.json");
/// Silent sessions that are averaged, and the seconds of each: eight minutes.
pub(super) const SESSIONS: (usize, usize) = (4, 120);
/// The same for a look.
pub(super) const FEW: (usize, usize) = (1, 20);
/// Pauses up to this long belong to the speech around them, frames.
const PAUSE: usize = 18;
/// A user whose head is slower than this stands, m/s.
const STANDS: f32 = 0.25;
/// A voice is silent after this long, frames.
const SILENT: usize = 32;
/// In an idle frame nobody has spoken or moved for this long, nor will, frames.
const QUIET: usize = 2 * FPS as usize;

/// A motion at rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Idle {
    /// Whose: `real people`, `corpus`, a sampler's, or a sampler's where no user is seen.
    pub name: String,
    /// Its measures.
    pub figures: Liveliness,
}

/// The file of statistics.
#[derive(Deserialize)]
struct File {
    real: Real,
}

/// Rows of real people: ten who stand about and do not act; gestures of two who talk.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(super) struct Real {
    pub(super) idle: Liveliness,
    pub(super) speaking: Liveliness,
}

impl Real {
    pub(super) fn read() -> Result<Self> {
        let damaged = |e| Error::new(ErrorKind::State, format!("the statistics of real people are damaged: {e}"));
        serde_json::from_str::<File>(PEOPLE).map(|file| file.real).map_err(damaged)
    }
}

/// Which of `frames` frames are speech: the voice's, with short pauses filled. No voice says
/// nothing.
pub(super) fn speech(voice: Option<Vec<f32>>, frames: usize) -> Vec<bool> {
    let mut speech = voice.map_or_else(|| vec![false; frames], |voice| speech_frames(&voice, frames));
    let mut last = None;
    for i in 0..frames {
        if speech[i] {
            if let Some(last) = last.filter(|last| i - last <= PAUSE) {
                speech[last..i].fill(true);
            }
            last = Some(i);
        }
    }
    speech
}

impl Idle {
    /// What the agents of conversation clips do while nobody speaks and the user stands; `None`
    /// where no clip is a conversation.
    pub(super) fn of_clips(rig: &Rig, clips: &[Clip]) -> Result<Option<Self>> {
        let mut tally = Tally::default();
        for clip in clips {
            let named = clip.path().file_name().is_some_and(|name| name.to_string_lossy().starts_with("talk_"));
            let all = clip.read(0, clip.frames())?;
            if named || all.agent_voice.is_some() || all.user_voice.is_some() {
                tally.add(rig, &all.frames, &idle(&all));
            }
        }
        let figures = tally.row();
        Ok((figures.seconds > 0.0).then(|| Self { name: "corpus".into(), figures }))
    }

    /// Silent sessions, how many and how long each, with a user who stands before the agent, or
    /// without one.
    pub(super) fn of_sessions(
        engine: &Arc<Engine>,
        options: &SessionOptions,
        seen: bool,
        threads: usize,
        (runs, seconds): (usize, usize),
    ) -> Result<Self> {
        let frames = seconds * FPS as usize;
        let tallies = each(threads, runs, &|_| {}, &|run| {
            let voice = || Some(vec![0.0; frames * FRAME_SAMPLES]);
            let user = std::iter::repeat_n(Vec3::new(0.0, 1.65, 1.6), if seen { frames } else { 0 });
            let options = SessionOptions { seed: options.seed + run as u64, ..options.clone() };
            let motion = generate(engine, options, [voice(), voice()], user, None)?.recording;
            let mut tally = Tally::default();
            let frames: &[Frame] = &motion.frames[LEAD.min(motion.frames.len())..];
            tally.add(&motion.rig, frames, &vec![true; frames.len()]);
            Ok(tally)
        })?;
        let name = made_with(engine, options.sampler);
        Ok(Self { name: if seen { name } else { alone(&name) }, figures: Tally::sum(tallies).row() })
    }
}

/// Name of a sampler's row at rest without a user.
pub(super) fn alone(name: &str) -> String {
    format!("{name}, nobody seen")
}

/// Frames in which the user speaks, has within a second, and the agent has not: what a session
/// knows of a listener.
pub(super) fn listening(segment: &Segment) -> Vec<bool> {
    let n = segment.frames.len();
    let (agent, user) = (speech(segment.agent(), n), speech(segment.user(), n));
    let lately = |mask: &[bool], i: usize| mask[(i + 1).saturating_sub(SILENT)..=i].contains(&true);
    (0..n).map(|i| !lately(&agent, i) && lately(&user, i)).collect()
}

/// Frames in which nobody speaks, nor does within two seconds, and the user stands.
fn idle(segment: &Segment) -> Vec<bool> {
    let n = segment.frames.len();
    let (agent, user) = (speech(segment.agent(), n), speech(segment.user(), n));
    let near = |mask: &[bool], i: usize| mask[i.saturating_sub(QUIET)..(i + QUIET + 1).min(n)].contains(&true);
    // The speed of the head over five frames: a standing head sways.
    let moves: Vec<bool> = (0..n)
        .map(|i| {
            let (a, b) = (i.saturating_sub(2), (i + 2).min(n - 1));
            segment.user[a].distance(segment.user[b]) * FPS as f32 > STANDS * (b - a).max(1) as f32
        })
        .collect();
    (0..n).map(|i| !near(&agent, i) && !near(&user, i) && !near(&moves, i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_statistics_of_real_people_can_be_read() {
        let real = Real::read().unwrap();
        let share = real.idle.stillness.unwrap();
        assert!((0.4..0.8).contains(&share), "people at rest are still most of the time: {share}");
        assert!(real.speaking.hand_speed.unwrap() > 3.0 * real.idle.hand_speed.unwrap());
        assert!(real.idle.seconds > 300.0 && real.idle.hand_spectrum.len() == 5);
    }

    #[test]
    fn short_pauses_belong_to_speech_and_idle_keeps_away_from_it() {
        let tone = |from: usize, to: usize| {
            (0..400 * FRAME_SAMPLES).map(move |i| {
                let loud = (from * FRAME_SAMPLES..to * FRAME_SAMPLES).contains(&i);
                if loud { 0.3 * (0.1 * i as f32).sin() } else { 0.0 }
            })
        };
        let mut voice: Vec<f32> = tone(50, 80).collect();
        voice.iter_mut().zip(tone(90, 120)).for_each(|(a, b)| *a += b);
        let found = speech(Some(voice.clone()), 400);
        assert!(found[85] && !found[140] && !found[20]);
        assert!(!speech(None, 5).contains(&true));

        let frames = vec![Frame::empty(1); 400];
        let user = (0..400).map(|i| Vec3::new(0.0, 1.6, if i < 300 { 1.6 } else { 1.6 + 0.02 * (i - 300) as f32 }));
        let sample = |v: &f32| (v * 32767.0) as i16;
        let segment = Segment {
            frames,
            user: user.collect(),
            user_rotation: None,
            agent_voice: Some(voice.iter().map(sample).collect()),
            user_voice: None,
        };
        // Speech from frame 50 to 120, of the agent, then of the user.
        assert!(!listening(&segment).contains(&true), "nobody to listen to");
        let heard = Segment { user_voice: segment.agent_voice.clone(), agent_voice: None, ..segment.clone() };
        let listens = listening(&heard);
        assert!(!listens[40] && listens[60] && listens[85] && listens[150] && !listens[160], "{listens:?}");
        let both = Segment { user_voice: segment.agent_voice.clone(), ..segment.clone() };
        assert!(!listening(&both).contains(&true), "it speaks itself");
        let idle = idle(&segment);
        assert!(!idle[10] && idle[200] && !idle[70] && !idle[135] && !idle[260] && !idle[350], "{idle:?}");
    }
}
