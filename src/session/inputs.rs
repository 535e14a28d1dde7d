//! From what was pushed to the conditioning of a block.

use super::gaze::Cue;
use super::probe::{Probe, tell};
use super::rest::{LOUD, Rest};
use super::stats::{Delays, InputStats};
#[cfg(feature = "tract")]
use crate::audio::TractEncoder;
use crate::audio::{AudioBackend, AudioEncoder, Speaker, Voice, VoiceInput};
use crate::config::{ACTIVITY, Company, Config};
use crate::dram::Seen;
use crate::engine::Engine;
use crate::error::Result;
use crate::flow::Condition;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FPS, FRAME_SAMPLES, Root, Transform};
use crate::hearing::{Hearing, SoundInput};
use crate::kernels::Exec;
use crate::session::SessionOptions;
use crate::user::{HeadInput, HeadTrack, Presence, UserSample};
use glam::Vec3;

/// Who listens for a block: two voices and the agent's ears.
pub(super) const LISTENERS: usize = 3;

/// A voice and the encoder that listens to it.
pub(super) struct EncodedVoice {
    voice: Voice,
    encoder: Encoder,
    samples: Box<[f32; BLOCK_SAMPLES]>,
    features: Vec<f32>,
    /// The last frame in which it spoke.
    spoke: Option<u64>,
    /// Whether `features` are those of the next block.
    heard: Result<bool>,
    /// Blocks by which it lags.
    delay: u64,
    /// The session's first block.
    first: u64,
    /// Whether the voice was present in the block before.
    open: bool,
}

/// The audio encoder on either backend.
enum Encoder {
    Kernels(AudioEncoder),
    #[cfg(feature = "tract")]
    Tract(TractEncoder),
}

impl Encoder {
    fn new(engine: &Engine, backend: AudioBackend) -> Result<Self> {
        Ok(match backend {
            AudioBackend::Kernels => Self::Kernels(AudioEncoder::new(&engine.config.audio)?),
            #[cfg(feature = "tract")]
            AudioBackend::Tract => Self::Tract(engine.audio_source.tract(&engine.config.audio)?),
        })
    }

    fn reset(&mut self) -> Result<()> {
        match self {
            Self::Kernels(encoder) => encoder.reset(),
            #[cfg(feature = "tract")]
            Self::Tract(encoder) => encoder.reset()?,
        }
        Ok(())
    }

    fn encode(&mut self, exec: &mut Exec, engine: &Engine, samples: &[f32], out: &mut [f32]) -> Result<()> {
        match self {
            Self::Kernels(encoder) => encoder.encode(exec, &engine.audio, samples, out),
            #[cfg(feature = "tract")]
            Self::Tract(encoder) => encoder.encode(samples, out)?,
        }
        Ok(())
    }
}

/// An encoder of another bundle, which hears a voice while the session's own does not.
pub(super) struct Ear {
    encoder: AudioEncoder,
    pub(super) features: Vec<f32>,
    open: bool,
}

impl Ear {
    pub(super) fn new(engine: &Engine) -> Result<Self> {
        let features = vec![0.0; BLOCK_FRAMES * engine.config.audio.features];
        Ok(Self { encoder: AudioEncoder::new(&engine.config.audio)?, features, open: false })
    }

    /// What it hears next starts a new signal.
    pub(super) fn close(&mut self) {
        self.open = false;
    }
}

/// All inputs of a session.
pub(super) struct Inputs {
    agent: EncodedVoice,
    user: EncodedVoice,
    /// Where the bundle has hearing.
    hearing: Option<Box<Hearing>>,
    head: HeadInput,
    track: HeadTrack,
    user_delay: u64,
    rest: Rest,
    pub(super) condition: Condition,
}

impl EncodedVoice {
    fn new(engine: &Engine, options: &SessionOptions, delay: u32) -> Result<Self> {
        Ok(Self {
            voice: Voice::with_capacity(options.voice_ahead),
            encoder: Encoder::new(engine, options.diagnostics.audio)?,
            samples: Box::new([0.0; BLOCK_SAMPLES]),
            features: vec![0.0; BLOCK_FRAMES * engine.config.audio.features],
            spoke: None,
            heard: Ok(false),
            delay: u64::from(delay),
            first: 0,
            open: false,
        })
    }

    fn reset(&mut self, first: u64) {
        self.voice.reset_at(first);
        (self.first, self.open, self.heard, self.spoke) = (first, false, Ok(false), None);
    }

    /// The block whose sound `block` may know, unless that was before the session's start.
    fn known(&self, block: u64) -> Option<u64> {
        block.checked_sub(self.delay).filter(|known| *known >= self.first)
    }

    /// Lets the sound that `block` may know go by unheard; the next that is heard starts a new
    /// signal.
    fn skip(&mut self, block: u64) -> Result<()> {
        self.open = false;
        self.known(block).map_or(Ok(()), |known| self.voice.take_block(known, &mut self.samples).map(drop))
    }

    /// As [`EncodedVoice::skip`], but that `ear` hears it, if there is any.
    fn lend(&mut self, exec: &mut Exec, engine: &Engine, block: u64, ear: &mut Ear) -> Result<bool> {
        self.open = false;
        let Some(known) = self.known(block) else { return Ok(false) };
        if !self.voice.take_block(known, &mut self.samples)? {
            ear.open = false;
            return Ok(false);
        }
        if !ear.open {
            ear.encoder.reset();
            ear.open = true;
        }
        ear.encoder.encode(exec, &engine.audio, &self.samples[..], &mut ear.features);
        Ok(true)
    }

    /// Takes the sound that `block` may know and makes features of it, if there is any.
    fn listen(&mut self, exec: &mut Exec, engine: &Engine, block: u64) -> Result<bool> {
        let Some(known) = self.known(block) else { return Ok(false) };
        if !self.voice.take_block(known, &mut self.samples)? {
            self.open = false;
            return Ok(false);
        }
        if !self.open {
            self.encoder.reset()?;
            self.open = true;
        }
        let mut frames = self.samples.chunks_exact(FRAME_SAMPLES);
        if let Some(last) = frames.rposition(|frame| frame.iter().any(|sample| sample.abs() > LOUD)) {
            self.spoke = Some(known * BLOCK_FRAMES as u64 + last as u64);
        }
        self.encoder.encode(exec, engine, &self.samples[..], &mut self.features)?;
        Ok(true)
    }

    /// The features that listening made for the next block, once.
    fn features(&mut self) -> Result<Option<&[f32]>> {
        let heard = std::mem::replace(&mut self.heard, Ok(false))?;
        Ok(heard.then_some(&self.features))
    }
}

/// What listens, for which block.
pub(super) enum Listening<'a> {
    /// A voice.
    Voice(u64, &'a mut EncodedVoice),
    /// The agent's ears, to the block before, in whose frames the head joint was there, and the
    /// sensitivity.
    Room(u64, &'a mut Hearing, [Transform; BLOCK_FRAMES], f32),
    /// Nobody.
    Nobody,
}

impl Listening<'_> {
    /// Whether there is anything to hear.
    fn hears(&self) -> bool {
        match self {
            Self::Voice(block, voice) => voice.voice.is_present() && voice.known(*block).is_some(),
            Self::Room(block, hearing, ..) => hearing.has_begun(*block),
            Self::Nobody => false,
        }
    }

    fn listen(&mut self, exec: &mut Exec, engine: &Engine) {
        match self {
            Self::Voice(block, voice) => voice.heard = voice.listen(exec, engine, *block),
            Self::Room(block, hearing, heads, sensitivity) => {
                if let Some(weights) = &engine.hearing {
                    hearing.listen(exec, weights, *block, heads, *sensitivity);
                }
            }
            Self::Nobody => {}
        }
    }
}

/// Lets all of `inputs`, of any sessions, listen: side by side where more than one has something to
/// hear.
pub(super) fn listen(exec: &mut Exec, engine: &Engine, inputs: &mut [Listening<'_>]) {
    if inputs.iter().filter(|input| input.hears()).count() > 1 {
        exec.each(inputs, |exec, input| input.listen(exec, engine));
    } else {
        // One by itself has both threads in each of its layers.
        inputs.iter_mut().for_each(|input| input.listen(exec, engine));
    }
}

impl Inputs {
    pub(super) fn new(engine: &Engine, options: &SessionOptions) -> Result<Self> {
        let hearing = engine.config.hearing.as_ref();
        let hearing = hearing.map(|config| Hearing::new(config, engine.config.rig.eyes[1]));
        Ok(Self {
            agent: EncodedVoice::new(engine, options, engine.config.agent_delay_blocks)?,
            user: EncodedVoice::new(engine, options, engine.config.user_delay_blocks)?,
            hearing: hearing.transpose()?.map(Box::new),
            head: HeadInput::new(),
            track: HeadTrack::new(),
            user_delay: u64::from(engine.config.user_delay_blocks),
            rest: Rest::new(),
            condition: Condition::absent(engine.layout()),
        })
    }

    /// Back to the start, which is that of block `first`.
    pub(super) fn reset(&mut self, first: u64) {
        self.agent.reset(first);
        self.user.reset(first);
        self.hearing.iter_mut().for_each(|hearing| hearing.reset());
        self.head.reset();
        self.track.reset();
        self.rest.reset();
        self.condition.clear();
    }

    /// Lets `block` go by: nobody listens.
    pub(super) fn skip(&mut self, block: u64) -> Result<()> {
        self.agent.skip(block)?;
        self.user.skip(block)?;
        self.skip_sounds(block);
        Ok(())
    }

    /// Lets the sounds that `block` may know go by unheard.
    fn skip_sounds(&mut self, block: u64) {
        if let (Some(hearing), Some(known)) = (&mut self.hearing, self.user.known(block)) {
            hearing.skip(known);
        }
    }

    /// Lets `ears` of `engine` listen for `block`, to the agent's voice and the user's; returns
    /// which of them was heard.
    pub(super) fn lend(
        &mut self,
        exec: &mut Exec,
        engine: &Engine,
        block: u64,
        [agent, user]: &mut [Ear; 2],
    ) -> Result<[bool; 2]> {
        self.skip_sounds(block);
        Ok([self.agent.lend(exec, engine, block, agent)?, self.user.lend(exec, engine, block, user)?])
    }

    /// Takes notice of what was pushed since the last time: the coming blocks know that and no
    /// more.
    pub(super) fn look(&mut self) {
        self.agent.voice.look();
        self.user.voice.look();
        self.head.drain(&mut self.track);
    }

    pub(super) fn voice(&self, speaker: Speaker) -> &VoiceInput {
        match speaker {
            Speaker::Agent => self.agent.voice.input(),
            Speaker::User => self.user.voice.input(),
        }
    }

    /// Takes notice of sounds in the room; `block` is due, with the agent at `root`. A sound that
    /// is new begins with that block.
    pub(super) fn look_for_sounds(&mut self, block: u64, root: &Root) {
        self.hearing.iter_mut().for_each(|hearing| hearing.begin(block, root));
    }

    /// Where what stands out of what is heard is, while that is known.
    pub(super) fn heard_place(&self) -> Option<Vec3> {
        self.hearing.as_ref().and_then(|hearing| hearing.place())
    }

    /// How much of what is heard calls for a reaction, 0 to 1.
    pub(super) fn reaction(&self) -> f32 {
        self.hearing.as_ref().map_or(0.0, |hearing| hearing.reaction())
    }

    /// The input of sounds in the room.
    pub(super) fn sounds(&self) -> SoundInput {
        self.hearing.as_ref().map_or_else(SoundInput::deaf, |hearing| hearing.input())
    }

    pub(super) fn head(&self) -> &HeadInput {
        &self.head
    }

    /// World position of the user's head in frame `frame`, as far as it is known at the start of
    /// its block.
    pub(super) fn head_at(&mut self, frame: u64) -> Option<Vec3> {
        let start = (frame - frame % BLOCK_FRAMES as u64) as f64 / f64::from(FPS);
        known(self.track.sample(frame as f64 / f64::from(FPS), start))
    }

    /// What is to [`listen`] for `block`; the head joint was at `heads` in the frames before it.
    pub(super) fn listening(
        &mut self,
        block: u64,
        heads: [Transform; BLOCK_FRAMES],
        sensitivity: f32,
    ) -> [Listening<'_>; LISTENERS] {
        let known = self.user.known(block);
        let room = match (&mut self.hearing, known) {
            (Some(hearing), Some(known)) => Listening::Room(known, hearing, heads, sensitivity),
            _ => Listening::Nobody,
        };
        [Listening::Voice(block, &mut self.agent), Listening::Voice(block, &mut self.user), room]
    }

    /// Makes the conditioning of `block`, for which voices have listened, with the agent's root at
    /// the end of the block before; `activity` says what a body at rest is told.
    pub(super) fn prepare(
        &mut self,
        block: u64,
        root: &Root,
        (gaze, activity): (Option<Cue>, &dyn Fn(Company) -> Option<[f32; ACTIVITY]>),
        sensitivity: f32,
        probe: &mut Option<&mut dyn Probe>,
    ) -> Result<()> {
        self.condition.clear();
        if let Some(features) = self.agent.features()? {
            self.condition.set_agent_voice(features);
            tell(probe, block, "agent_features", features);
        }
        if let Some(features) = self.user.features()? {
            self.condition.set_user_voice(features);
            tell(probe, block, "user_features", features);
        }
        let user = self.user_in_agent_frame(block, root);
        if let Some((positions, _)) = user {
            self.condition.set_user(&positions);
            tell(probe, block, "conditioning.user", &positions);
        }
        if let Some(hearing) = self.hearing.as_mut().filter(|hearing| hearing.has_heard()) {
            let vector = hearing.vector(root, sensitivity);
            self.condition.set_sound(vector);
            tell(probe, block, "conditioning.sound", vector);
            tell(probe, block, "hearing.ears", hearing.ears());
            tell(probe, block, "hearing.features", hearing.features());
        }
        if let Some(Cue { value, guided }) = gaze {
            self.condition.set_gaze(value, guided);
        }
        let spoke = [self.agent.spoke, self.user.spoke];
        let company = self.rest.look(block, spoke, user.map(|(_, last)| last), self.reaction());
        if let Some(level) = company.and_then(activity) {
            self.condition.set_activity(&level);
            tell(probe, block, "conditioning.activity", &level);
        }
        Ok(())
    }

    /// Which voices, the agent's and the user's, were heard for `block`.
    pub(super) fn heard(&mut self, block: u64, probe: &mut Option<&mut dyn Probe>) -> Result<[bool; 2]> {
        let agent = self.agent.features()?.inspect(|features| tell(probe, block, "agent_features", features)).is_some();
        let user = self.user.features()?.inspect(|features| tell(probe, block, "user_features", features)).is_some();
        Ok([agent, user])
    }

    /// Features of both voices, `[4, features]` each, which mean something where they were heard.
    pub(super) fn voice_features(&self) -> [&[f32]; 2] {
        [&self.agent.features, &self.user.features]
    }

    /// The user's head in each of the four frames that `block` may know, and the wanted gaze.
    pub(super) fn seen(&mut self, block: u64, gaze: Option<f32>) -> [Seen; BLOCK_FRAMES] {
        let mut samples = [UserSample::default(); BLOCK_FRAMES];
        if let Some(seen) = block.checked_sub(self.user_delay).filter(|seen| *seen >= self.user.first) {
            let now = (block * BLOCK_FRAMES as u64) as f64 / f64::from(FPS);
            self.track.block(seen * BLOCK_FRAMES as u64, now, &mut samples);
        }
        samples.map(|sample| Seen { head: known(sample), rotation: sample.rotation, gaze })
    }

    /// Floor positions `(x, z)` of the user over the four frames that `block` may know, in the
    /// agent's frame, and the last of them in the world; `None` when that is not known. Unknown
    /// earlier ones take the position that follows them.
    fn user_in_agent_frame(&mut self, block: u64, root: &Root) -> Option<([f32; 8], Vec3)> {
        let seen = block.checked_sub(self.user_delay).filter(|seen| *seen >= self.user.first)?;
        let now = (block * BLOCK_FRAMES as u64) as f64 / f64::from(FPS);
        let mut samples = [UserSample::default(); BLOCK_FRAMES];
        self.track.block(seen * BLOCK_FRAMES as u64, now, &mut samples);
        let last = known(samples[BLOCK_FRAMES - 1])?;
        let mut next = last;
        let mut positions = [0.0; 2 * BLOCK_FRAMES];
        for (sample, xz) in samples.iter().zip(positions.chunks_exact_mut(2)).rev() {
            next = known(*sample).unwrap_or(next);
            let local = root.to_local(next);
            xz.copy_from_slice(&[local.x, local.z]);
        }
        Some((positions, last))
    }

    pub(super) fn stats(&self) -> InputStats {
        InputStats {
            agent_voice: self.agent.voice.stats(),
            user_voice: self.user.voice.stats(),
            head: self.head.stats(&self.track),
            sounds: self.hearing.as_ref().map_or_else(Default::default, |hearing| hearing.stats()),
        }
    }

    pub(super) fn delays(&self, config: &Config) -> Delays {
        let block = 1000.0 * BLOCK_FRAMES as f64 / f64::from(FPS);
        let lag = |voice: &Voice| 1000.0 * voice.lag_samples() as f64 / f64::from(crate::frame::SAMPLE_RATE);
        Delays {
            user_ms: block * f64::from(config.user_delay_blocks),
            agent_ms: block * f64::from(config.agent_delay_blocks),
            user_resampler_ms: lag(&self.user.voice),
            agent_resampler_ms: lag(&self.agent.voice),
        }
    }
}

fn known(sample: UserSample) -> Option<Vec3> {
    (sample.presence != Presence::Absent).then_some(sample.position)
}
