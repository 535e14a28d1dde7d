//! Whole files in, a [`Recording`] out: what the command line does, for programs that work on
//! finished recordings.
//!
//! ```text
//! Conversation (voices at 24 kHz, path) -> run(session) -> Outcome (recording, statistics) -> OutputFolder -> files
//! ```
//!
//! A [`Session`] is driven exactly as a live caller drives it: sound and head positions are pushed
//! in order and each block is polled when it is due, so an offline run gives the motion that a live
//! one would have given.
//!
//! ```no_run
//! # fn main() -> visavis::Result<()> {
//! use visavis::{Engine, SessionOptions};
//! use visavis_tools::offline::{Conversation, run};
//!
//! let engine = Engine::load("models/visavis-room-i8.safetensors")?;
//! let mut session = engine.session(SessionOptions::default())?;
//! let talk = Conversation::read(Some("agent.wav".as_ref()), None, Some("user.csv".as_ref()))?;
//! let outcome = run(&mut session, &talk, &mut |p| eprintln!("{} of {} frames", p.frames, p.total))?;
//! visavis_tools::export::write_bvh(&outcome.recording, "motion.bvh")?;
//! # Ok(())
//! # }
//! ```

mod csv;
mod ears;
mod output;
mod path;
mod sound;
mod wav;

pub use csv::UserPath;
pub use ears::Ears;
pub use output::{FILES, OutputFolder};
pub use path::for_session;
pub use sound::Sound;
pub use wav::Wav;

use crate::recording::{Recording, Sounds, Source};
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, Instant};
use visavis::internals::frame::{BLOCK_SAMPLES, FRAME_SAMPLES};
use visavis::internals::quant::{self, Scene};
use visavis::internals::session::Probe;
use visavis::stats::SessionStats;
use visavis::{BLOCK_FRAMES, Error, ErrorKind, FPS, Result, SAMPLE_RATE, Session};

/// Longest conversation that is taken, seconds: longer ones are wrong units or clock times more
/// often than they are meant.
pub const MAX_SECONDS: f64 = 2.0 * 3600.0;

/// What one conversation sounds and looks like; at least one part is there, and it is longer than
/// nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Conversation {
    agent: Option<Vec<f32>>,
    user: Option<Vec<f32>>,
    path: Option<UserPath>,
    /// Sounds in the room, each with the number of its source.
    sounds: Vec<(u32, Sound)>,
    /// What two microphones at the agent's ears hear.
    ears: Option<Ears>,
}

impl Conversation {
    /// Reads the agent's voice, the user's voice (WAV, see [`Wav::read`]) and the path of the
    /// user's head (CSV, see [`UserPath::read`]). What is `None` is absent, which is not the same
    /// as silent or far away.
    ///
    /// # Errors
    /// Those of the readers, and of [`Conversation::new`], naming the file.
    pub fn read(agent: Option<&Path>, user: Option<&Path>, path: Option<&Path>) -> Result<Self> {
        Self::read_with(agent, user, path, Vec::new(), None)
    }

    /// As [`Conversation::read`], with sounds in the room: without an `id` each is a source of its
    /// own; sounds of one source are more than two blocks (0.27 s) apart. And with what two
    /// microphones at the agent's ears hear.
    ///
    /// # Errors
    /// As [`Conversation::read`]; [`ErrorKind::Argument`] for sounds of one source that are not.
    pub fn read_with(
        agent: Option<&Path>,
        user: Option<&Path>,
        path: Option<&Path>,
        sounds: Vec<Sound>,
        ears: Option<Ears>,
    ) -> Result<Self> {
        let voice = |file: &Path| Wav::read(file)?.to_24k().map_err(|e| e.with_path(file));
        let talk = Self {
            agent: agent.map(voice).transpose()?,
            user: user.map(voice).transpose()?,
            path: path.map(UserPath::read).transpose()?,
            sounds: numbered(sounds)?,
            ears,
        };
        // The length is checked file by file, so that the error can name the one that is too long.
        for (file, seconds) in [agent, user, path].into_iter().zip(talk.lengths()) {
            if let (Some(file), Some(seconds)) = (file, seconds) {
                check_length(seconds).map_err(|e| e.with_path(file))?;
            }
        }
        talk.checked().map_err(|e| match path {
            Some(file) => e.with_path(file),
            None => e,
        })
    }

    /// A conversation from voices at 24 kHz mono (full scale 1, finite, sample `n` at `n / 24000`
    /// s) and a path.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when there is nothing at all; [`ErrorKind::UserPath`] when the path
    /// is all there is and ends at or before 0 s; either when a part is longer than
    /// [`MAX_SECONDS`].
    pub fn new(agent: Option<Vec<f32>>, user: Option<Vec<f32>>, path: Option<UserPath>) -> Result<Self> {
        let talk = Self { agent, user, path, sounds: Vec::new(), ears: None };
        talk.lengths().into_iter().flatten().try_for_each(check_length)?;
        talk.checked()
    }

    fn checked(self) -> Result<Self> {
        if self.frames() > 0 {
            return Ok(self);
        }
        Err(match &self.path {
            None => {
                Error::new(ErrorKind::Argument, "nothing to generate from: give a voice, the user's path or a sound")
            }
            Some(path) => Error::new(
                ErrorKind::UserPath,
                format!(
                    "the path ends at {} s, so the conversation has no length; times count from 0, the start",
                    path.end()
                ),
            ),
        })
    }

    /// Seconds of the agent's voice, the user's voice, the path and the sounds.
    fn lengths(&self) -> [Option<f64>; 4] {
        let voice = |v: &Vec<f32>| v.len() as f64 / f64::from(SAMPLE_RATE);
        let ends = self.sounds.iter().map(|(_, sound)| sound.end());
        let sounds = ends.chain(self.ears.as_ref().map(Ears::end)).reduce(f64::max);
        [self.agent.as_ref().map(voice), self.user.as_ref().map(voice), self.path.as_ref().map(UserPath::end), sounds]
    }

    /// Length, seconds: that of the longest part.
    pub fn seconds(&self) -> f64 {
        self.lengths().into_iter().flatten().fold(0.0, f64::max)
    }

    /// Frames of motion that cover it, at 30 fps.
    pub fn frames(&self) -> usize {
        // The tolerance keeps a length such as 0.1 s, which is no binary fraction, from costing a
        // frame.
        (self.seconds() * f64::from(FPS) - 1e-6).ceil().max(0.0) as usize
    }

    /// The agent's voice, 24 kHz mono.
    pub fn agent(&self) -> Option<&[f32]> {
        self.agent.as_deref()
    }

    /// The user's voice, 24 kHz mono.
    pub fn user(&self) -> Option<&[f32]> {
        self.user.as_deref()
    }

    /// The first `blocks` blocks (all of them when there are fewer) as the quantiser takes them,
    /// sounds included, with a gaze target or none.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when there is not a whole block.
    pub fn scene(&self, blocks: usize, gaze: Option<f32>) -> Result<Scene> {
        let heads = self.path.as_ref().map(for_session).unwrap_or_default();
        let sounds = self.sounds.iter().map(|(id, sound)| {
            let first = first_sample(sound);
            let samples = [&vec![0.0; first % BLOCK_SAMPLES][..], &sound.samples].concat();
            quant::Sound { id: *id, place: sound.place.as_vec3(), block: first / BLOCK_SAMPLES, samples }
        });
        let scene = Scene::new(self.agent(), self.user(), heads, blocks.min(self.frames() / BLOCK_FRAMES), gaze)?;
        Ok(scene.with_sounds(sounds.collect()))
    }

    /// Sounds in the room, each with the number of its source.
    pub fn sounds(&self) -> &[(u32, Sound)] {
        &self.sounds
    }

    /// Whether there is anything in the room to hear.
    pub fn has_sounds(&self) -> bool {
        !self.sounds.is_empty() || self.ears.is_some()
    }

    /// The path of the user's head.
    pub fn path(&self) -> Option<&UserPath> {
        self.path.as_ref()
    }
}

/// Sounds with the numbers of their sources.
fn numbered(sounds: Vec<Sound>) -> Result<Vec<(u32, Sound)>> {
    let given: Vec<_> = sounds.iter().filter_map(|sound| sound.id).collect();
    let mut free = (0..).filter(|id| !given.contains(id));
    let mut numbered: Vec<(u32, Sound)> = Vec::with_capacity(sounds.len());
    for sound in sounds {
        // There are more numbers than sounds.
        let id = sound.id.or_else(|| free.next()).unwrap_or(u32::MAX);
        let close =
            |other: &Sound| blocks(other).start <= blocks(&sound).end && blocks(&sound).start <= blocks(other).end;
        if let Some((_, other)) = numbered.iter().find(|(other, sound)| *other == id && close(sound)) {
            let message = format!(
                "the sounds {} and {} have one source, {id}, and are less than 0.27 s apart; give them ids of their own",
                other.name, sound.name
            );
            return Err(Error::new(ErrorKind::Argument, message));
        }
        numbered.push((id, sound));
    }
    Ok(numbered)
}

/// The blocks in which a sound is heard, and one more.
fn blocks(sound: &Sound) -> Range<usize> {
    let start = first_sample(sound);
    start / BLOCK_SAMPLES..(start + sound.samples.len()).div_ceil(BLOCK_SAMPLES) + 1
}

fn first_sample(sound: &Sound) -> usize {
    first_of(sound.start)
}

/// The sample at a time.
fn first_of(start: f64) -> usize {
    (start * f64::from(SAMPLE_RATE)).round() as usize
}

/// What is heard in block `block`, from the block's start on, of ears that begin at a time.
fn ears_piece(ears: &Ears, block: usize) -> Option<[Vec<f32>; 2]> {
    let ear = |side: usize| piece_of(&ears.samples[side], first_of(ears.start), block);
    Some([ear(0)?, ear(1)?])
}

/// What a source gives off in block `block`, from the block's start on; none before the sound
/// begins and after it has ended.
fn piece(sound: &Sound, block: usize) -> Option<Vec<f32>> {
    piece_of(&sound.samples, first_sample(sound), block)
}

/// The samples of block `block`, from its start on, of those that begin with sample `first`.
fn piece_of(samples: &[f32], first: usize, block: usize) -> Option<Vec<f32>> {
    let from = block * BLOCK_SAMPLES;
    let silence = first.saturating_sub(from);
    if silence >= BLOCK_SAMPLES {
        return None;
    }
    let rest = samples.get(from.saturating_sub(first)..).filter(|rest| !rest.is_empty())?;
    let mut piece = vec![0.0; silence];
    piece.extend_from_slice(&rest[..rest.len().min(BLOCK_SAMPLES - silence)]);
    Some(piece)
}

/// What the agent hears of all sounds, the mean of its ears.
struct HeardSounds(Vec<f32>);

impl Probe for HeardSounds {
    fn stage(&mut self, block: u64, name: &'static str, values: &[f32]) {
        if let ("hearing.ears", Some(before)) = (name, block.checked_sub(1)) {
            let (left, right) = values.split_at(BLOCK_SAMPLES);
            let out = self.0.iter_mut().skip(before as usize * BLOCK_SAMPLES);
            out.zip(left.iter().zip(right)).for_each(|(out, (l, r))| *out = (0.5 * (l + r)).clamp(-1.0, 1.0));
        }
    }
}

fn check_length(seconds: f64) -> Result<()> {
    if seconds <= MAX_SECONDS {
        return Ok(());
    }
    let message = format!(
        "lasts until {seconds:.0} s, longer than {MAX_SECONDS:.0} s; times are seconds since the start of the \
         conversation (subtract a clock's start time), and longer recordings go in parts"
    );
    Err(Error::new(ErrorKind::Argument, message))
}

/// How far a run has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Frames done.
    pub frames: usize,
    /// Frames that there will be.
    pub total: usize,
    /// Time since the run started.
    pub elapsed: Duration,
}

/// What came out of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The motion, with what was heard and seen.
    pub recording: Recording,
    /// Block times, delays and counters.
    pub stats: SessionStats,
    /// Time that pushing and computing took, without loading files and models.
    pub elapsed: Duration,
}

impl Outcome {
    /// Frames generated a second.
    pub fn frames_per_second(&self) -> f64 {
        self.recording.frames.len() as f64 / self.elapsed.as_secs_f64().max(1e-9)
    }

    /// Seconds of motion generated a second: above 1 is faster than real time.
    pub fn real_time_factor(&self) -> f64 {
        self.frames_per_second() / f64::from(FPS)
    }
}

/// The sounds of a conversation, for its recording.
fn recorded(talk: &Conversation, heard: Vec<f32>) -> Option<Sounds> {
    let source = |(_, sound): &(u32, Sound)| Source {
        name: sound.name.clone(),
        position: sound.place.as_vec3(),
        seconds: [sound.start, sound.end()],
    };
    talk.has_sounds().then(|| Sounds { sources: talk.sounds.iter().map(source).collect(), heard })
}

/// Resets `session`, plays the whole conversation to it and returns the motion; `progress` is
/// called after each block.
///
/// Voices come a block ahead, as from text-to-speech; the session itself never uses the user's
/// future. Sounds come block by block, and begin when they say, to the sample.
///
/// # Errors
/// Those of pushing and polling; none for finite voices and a session that was just made.
/// [`ErrorKind::Argument`] for sounds where the bundle has no hearing.
pub fn run(session: &mut Session, talk: &Conversation, progress: &mut dyn FnMut(Progress)) -> Result<Outcome> {
    session.reset()?;
    let place = |sound: &Sound| sound.place.as_vec3();
    for (id, sound) in &talk.sounds {
        // An empty piece: whether it could be pushed at all.
        session.push_sound(*id, &[], SAMPLE_RATE, place(sound))?;
    }
    if talk.ears.is_some() {
        session.push_ears(&[], &[], SAMPLE_RATE)?;
    }
    let mut heard = HeardSounds(vec![0.0; if talk.has_sounds() { talk.frames() * FRAME_SAMPLES } else { 0 }]);
    let total = talk.frames();
    let points = talk.path.as_ref().map(path::poses_for_session).unwrap_or_default();
    let mut points = points.into_iter().peekable();
    let mut voices = [talk.agent.as_deref(), talk.user.as_deref()].map(|v| v.unwrap_or_default().chunks(BLOCK_SAMPLES));
    let mut frames = Vec::with_capacity(total);
    let started = Instant::now();
    for block in 0..total.div_ceil(BLOCK_FRAMES) {
        let now = session.next_due();
        if let Some(samples) = voices[0].next() {
            session.push_agent_audio(samples, SAMPLE_RATE)?;
        }
        if let Some(samples) = voices[1].next() {
            session.push_user_audio(samples, SAMPLE_RATE)?;
        }
        while let Some((time, position, rotation)) = points.next_if(|(time, ..)| *time <= now) {
            session.push_user_pose(position, rotation, time)?;
        }
        for (id, sound) in &talk.sounds {
            if let Some(piece) = piece(sound, block) {
                session.push_sound(*id, &piece, SAMPLE_RATE, place(sound))?;
            }
        }
        if let Some([left, right]) = talk.ears.as_ref().and_then(|ears| ears_piece(ears, block)) {
            session.push_ears(&left, &right, SAMPLE_RATE)?;
        }
        let probe = talk.has_sounds().then_some(&mut heard as &mut dyn Probe);
        if let Some(block) = session.poll_with(now, probe)? {
            let wanted = block.len().min(total - frames.len());
            frames.extend_from_slice(&block[..wanted]);
        }
        progress(Progress { frames: frames.len(), total, elapsed: started.elapsed() });
    }
    let elapsed = started.elapsed();
    let user = frames.iter().map(|f| talk.path.as_ref().and_then(|p| p.at(f.time))).collect();
    let recording = Recording {
        rig: session.engine().config().rig.clone(),
        frames,
        user,
        agent_voice: talk.agent.clone(),
        user_voice: talk.user.clone(),
        gaze_target: session.options().gaze,
        sounds: recorded(talk, heard.0),
    };
    Ok(Outcome { recording, stats: session.stats(), elapsed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room;
    use visavis::internals::quant::Teacher;
    use visavis::internals::session::Anchoring;
    use visavis::internals::user::HeadTrack;
    use visavis::{Engine, Sampler, SessionOptions};

    fn path(text: &str) -> Option<UserPath> {
        Some(UserPath::parse(text).unwrap())
    }

    #[test]
    fn the_longest_part_gives_the_length() {
        let talk = Conversation::new(Some(vec![0.0; 24_000]), None, path("t,x,y,z\n0,0,0,0\n0.1,0,0,0\n")).unwrap();
        assert_eq!((talk.seconds(), talk.frames()), (1.0, 30));
        let talk = Conversation::new(Some(vec![0.0; 24_001]), None, None).unwrap();
        assert_eq!(talk.frames(), 31);
        let talk = Conversation::new(None, Some(vec![0.0; 10]), path("t,x,y,z\n0,0,0,0\n0.1,0,0,0\n")).unwrap();
        assert_eq!((talk.seconds(), talk.frames()), (0.1, 3));
    }

    #[test]
    fn conversations_without_length_or_end_are_refused() {
        let kind = |agent, path| Conversation::new(agent, None, path).unwrap_err().kind();
        assert_eq!(kind(None, None), ErrorKind::Argument);
        assert_eq!(kind(Some(Vec::new()), None), ErrorKind::Argument);
        assert_eq!(kind(None, path("t,x,y,z\n-1,0,0,0\n0,0,0,0\n")), ErrorKind::UserPath);
        let e = Conversation::new(None, None, path("t,x,y,z\n0,0,0,0\n1.7e9,0,0,0\n")).unwrap_err();
        assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("clock"), "{e}");
    }

    #[test]
    fn the_sample_conversation_is_usable() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../samples");
        let path = UserPath::read(folder.join("user.csv")).unwrap();
        for voice in ["agent.wav", "user.wav"] {
            let wav = Wav::read(folder.join(voice)).unwrap();
            assert_eq!(wav.to_24k().unwrap().len(), 219 * BLOCK_SAMPLES, "{voice}");
            assert!((wav.seconds() - path.end()).abs() < 0.02);
            let spoken = wav.samples.iter().filter(|s| s.abs() > 0.02).count();
            assert!(spoken > wav.samples.len() / 20, "{voice} is silent");
        }
        let mut track = HeadTrack::new();
        path.points().iter().for_each(|&(time, position)| track.push(position, time));
        let stats = track.stats();
        assert_eq!((stats.accepted, stats.teleports, stats.overwritten), (path.points().len() as u64, 0, 0));
    }

    /// The sessions of the quantiser and of the report hear what any session hears.
    #[test]
    fn a_scene_sounds_as_its_conversation_does() {
        let golden = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/hearing.safetensors");
        let engine = Engine::load(golden).unwrap();
        let sounds = room::around().into_iter().take(2).collect();
        let talk = Conversation::read_with(None, None, None, sounds, None).unwrap();
        let sampler = Sampler::Midpoint2;
        let teacher = Teacher::new(&engine, talk.scene(20, None).unwrap(), sampler, 3, &mut None).unwrap();
        let options = SessionOptions { seed: 3, sampler, diagnostics: Anchoring::Never.into(), ..Default::default() };
        let outcome = run(&mut engine.session(options).unwrap(), &talk, &mut |_| {}).unwrap();
        assert_eq!(outcome.stats.inputs.sounds.started, 2);
        assert!(teacher.frames().eq(&outcome.recording.frames[..80]));
    }

    #[test]
    fn sounds_are_cut_at_blocks_and_begin_to_the_sample() {
        let sound = |start: f64, samples: usize, id| Sound {
            name: "bang".to_owned(),
            samples: (0..samples).map(|i| 1.0 + i as f32).collect(),
            place: glam::DVec3::ZERO,
            start,
            id,
        };
        let bang = sound(0.3, 5_000, None);
        let pieces: Vec<_> = (0..6).map(|block| piece(&bang, block)).collect();
        // 7200 samples: 800 after the start of the third block.
        assert_eq!(pieces.iter().map(|p| p.as_ref().map_or(0, Vec::len)).collect::<Vec<_>>(), [0, 0, 3200, 2600, 0, 0]);
        let all: Vec<_> = pieces.into_iter().flatten().flatten().collect();
        assert!(all[..800].iter().all(|s| *s == 0.0) && all[800..] == bang.samples);
        let talk = |sounds| Conversation::read_with(None, None, None, sounds, None);
        let two = talk(vec![sound(0.0, 100, None), sound(0.0, 100, Some(0)), sound(1.0, 2_400, Some(0))]).unwrap();
        assert_eq!(two.sounds().iter().map(|(id, _)| *id).collect::<Vec<_>>(), [1, 0, 0]);
        assert!((two.seconds() - 1.1).abs() < 1e-9);
        let e = talk(vec![sound(0.0, 100, Some(3)), sound(0.2, 100, Some(3))]).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Argument);
    }
}
