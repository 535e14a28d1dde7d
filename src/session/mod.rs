//! Sessions: one conversation with one user. The one place that knows all stages.
//!
//! ```text
//! push audio, head, sounds -> inputs -> condition -> generator -> latent -> decoder -> features -> motion -> frames -> poll
//! ```
//!
//! | file | what |
//! |---|---|
//! | `poll` | session time to blocks, starting anew |
//! | `settings` | what may be set while it runs, and the governor's decisions |
//! | `options` | what a session is made with |
//! | `controls` | settings from other threads |
//! | `shared` | a session, its inputs and its controls, for several threads |
//! | `diagnostics` | what measurements and tests change about it |
//! | `inputs` | voices, head positions and sounds to the conditioning of a block |
//! | `gaze` | the wanted gaze to the gaze channel, free gaze included |
//! | `rest` | whether the body is at rest, and how active it is then |
//! | `state` | all that changes from block to block |
//! | `maker` | what makes the poses, by the bundle's kind |
//! | `by_latent` | the flow model: a latent a block, decoded |
//! | `by_step` | the featherweight tier: a step a frame |
//! | `fallback` | the featherweight tier in place of a held pose |
//! | `block` | a block, stage by stage |
//! | `pipeline` | the computation of blocks, one or several together |
//! | `tools` | threads, working memory and weights, which blocks are computed with |
//! | `noise` | seeded noise, or given |
//! | `anchor` | re-anchoring: encoding recent motion anew, spread over blocks |
//! | `governor/` | quality traded for time, block by block |
//! | `team` | several sessions stepped together |
//! | `stats` | block times and counters |
//! | `forcing` | what the quantiser's teacher does to a session |
//! | `probe` | every stage of a block, for whoever wants to check the maths |
//!
//! Inputs and settings may come from any thread while a block is computed ([`VoiceInput`],
//! [`HeadInput`], [`SoundInput`], [`Controls`]): nobody waits for the block, and a block goes by
//! what was there when its poll began.
//!
//! After [`Session::poll`] has been called once, computing a block allocates nothing, takes no lock
//! and makes no system call. The exceptions are outside the block: the first push of a voice, or a
//! change of its rate, makes a resampler.

mod anchor;
mod block;
mod by_latent;
mod by_step;
mod controls;
mod diagnostics;
mod fallback;
#[cfg(feature = "quant")]
mod forcing;
mod gaze;
mod governor;
mod inputs;
mod maker;
mod noise;
mod options;
mod pipeline;
mod poll;
mod probe;
mod rest;
mod settings;
mod shared;
mod state;
mod stats;
mod team;
mod tools;

pub use controls::Controls;
pub use diagnostics::{Anchoring, Diagnostics, HistoryTime};
#[cfg(feature = "quant")]
pub(crate) use forcing::MadeBlock;
pub use gaze::GazeControl;
pub use governor::{Budget, Decision, Governor, GovernorStats, Hold, Plan};
pub use options::SessionOptions;
pub use probe::Probe;
pub use shared::SharedSession;
pub use stats::{Delays, InputStats, SessionStats};
pub use team::Team;

use crate::audio::{Speaker, VoiceInput};
use crate::engine::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::Frame;
use crate::hearing::SoundInput;
use crate::kernels::Exec;
use crate::user::HeadInput;
use glam::{Quat, Vec3};
use governor::{Log, Policy};
use state::BlockState;
use std::sync::Arc;
use tools::Workspace;

impl Engine {
    /// Starts a session; all memory that it will need is taken here.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when an option is out of range or the bundle cannot do it.
    pub fn session(self: &Arc<Self>, options: SessionOptions) -> Result<Session> {
        Session::new(Arc::clone(self), options)
    }

    /// What it takes to step several sessions of this engine together, on `threads` threads (1 or
    /// 2): [`Team`] tells how.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another number of threads; [`ErrorKind::Io`] when the second one
    /// cannot be started.
    pub fn team(self: &Arc<Self>, threads: usize) -> Result<Team> {
        Team::new(Arc::clone(self), threads)
    }
}

/// All mutable state of one conversation.
///
/// Time is the caller's: seconds since the session started, the same clock for
/// [`Session::push_user_head`] and [`Session::poll`]. Audio has no timestamps: each voice is one
/// continuous stream that starts at time 0.
pub struct Session {
    engine: Arc<Engine>,
    options: SessionOptions,
    exec: Exec,
    work: Workspace,
    state: BlockState,
    controls: Controls,
    now: f64,
    times: stats::BlockTimes,
    policy: Option<Policy>,
    log: Log,
    /// The last block, until the next decision: its plan, its work, and the milliseconds that it
    /// took.
    last: Option<(Plan, f64, f64)>,
    /// In the hands of a team: the block that is due, and the one that is computed.
    due: Option<team::Due>,
    done: Option<team::Due>,
}

impl Session {
    pub(crate) fn new(engine: Arc<Engine>, options: SessionOptions) -> Result<Self> {
        options.check(&engine)?;
        let mut exec = engine.exec(options.threads)?;
        options.core_mask.map_or(Ok(()), |mask| exec.pool_mut().pin_helper(mask))?;
        Self::on(exec, engine, options)
    }

    /// A session on the threads of `exec`; its options have been checked.
    fn on(mut exec: Exec, engine: Arc<Engine>, options: SessionOptions) -> Result<Self> {
        let state = BlockState::new(&mut exec, &engine, &options)?;
        let mut session = Self {
            work: Workspace::new(&engine, 1, 1),
            controls: Controls::new(&engine, |sampler| state.supports(sampler)),
            engine,
            options,
            exec,
            state,
            now: 0.0,
            times: stats::BlockTimes::new(),
            policy: None,
            log: Log::new(),
            last: None,
            due: None,
            done: None,
        };
        session.reset()?;
        Ok(session)
    }

    /// Appends to a voice: mono samples, full scale 1, any rate from 8 to 192 kHz. The same as
    /// [`VoiceInput::push`] of [`Session::voice_input`].
    ///
    /// The voice may come ahead of time (text-to-speech does) by up to
    /// [`SessionOptions::voice_ahead`]. Sound that has not
    /// come when a block is computed is silence there, is counted, and is heard later. A voice that
    /// has never been pushed is absent, which is not the same as silent.
    ///
    /// # Errors
    /// As [`VoiceInput::push`]: [`ErrorKind::Audio`] for a bad rate or samples that are not finite.
    pub fn push_audio(&mut self, speaker: Speaker, samples: &[f32], rate: u32) -> Result<()> {
        self.state.inputs.voice(speaker).push(samples, rate)
    }

    /// [`Session::push_audio`] of the agent's own voice.
    ///
    /// # Errors
    /// As [`Session::push_audio`].
    pub fn push_agent_audio(&mut self, samples: &[f32], rate: u32) -> Result<()> {
        self.push_audio(Speaker::Agent, samples, rate)
    }

    /// [`Session::push_audio`] of the user's voice.
    ///
    /// # Errors
    /// As [`Session::push_audio`].
    pub fn push_user_audio(&mut self, samples: &[f32], rate: u32) -> Result<()> {
        self.push_audio(Speaker::User, samples, rate)
    }

    /// Tells where the user's head is (midpoint of the eyes), world metres, at `time` seconds of
    /// session time. The same as [`HeadInput::push`] of [`Session::head_input`].
    ///
    /// Any rate; positions that are not finite, late, or impossible are ignored and counted (see
    /// [`Session::stats`]).
    ///
    /// # Errors
    /// None today; the result leaves room for typed refusals.
    pub fn push_user_head(&mut self, position: Vec3, time: f64) -> Result<()> {
        self.push_user_pose(position, None, time)
    }

    /// As [`Session::push_user_head`], with the head's rotation where it is known: a quaternion of
    /// about unit length in the world, identity where the user faces +Z. The same as
    /// [`HeadInput::push_pose`]. Bundles of the kind `dram` see where the user's face points and how
    /// it nods; the others make the same motion with and without.
    ///
    /// # Errors
    /// As [`Session::push_user_head`].
    pub fn push_user_pose(&mut self, position: Vec3, rotation: Option<Quat>, time: f64) -> Result<()> {
        self.state.inputs.head().push_pose(position, rotation, time);
        self.state.inputs.look();
        Ok(())
    }

    /// Pushes a piece of what source `id` in the room gives off: mono `samples` of `rate` Hz,
    /// pascals as they are 1 m from it (RMS 1 is 94 dB SPL); from now on it is at `position`, world
    /// metres. The same as [`SoundInput::push`] of [`Session::sounds`], which says more.
    ///
    /// What is pushed before the poll of a block sounds from that block's start on; the agent
    /// answers with the block after it. Until the first push the agent is as one of a bundle
    /// without hearing, to the bit.
    ///
    /// # Errors
    /// As [`SoundInput::push`]: [`ErrorKind::Argument`] where the bundle has no hearing, or for a
    /// position that is no number; [`ErrorKind::Audio`] for a bad rate or samples that are not
    /// finite.
    pub fn push_sound(&mut self, id: u32, samples: &[f32], rate: u32, position: Vec3) -> Result<()> {
        self.state.inputs.sounds().push(id, samples, rate, position)
    }

    /// Stops source `id` at once. The same as [`SoundInput::end`] of [`Session::sounds`].
    ///
    /// # Errors
    /// As [`SoundInput::end`].
    pub fn end_sound(&mut self, id: u32) -> Result<()> {
        self.state.inputs.sounds().end(id)
    }

    /// Pushes a piece of what two microphones at the agent's ears hear, pascals, as many samples of
    /// each; where it comes from is estimated. The same as [`SoundInput::push_ears`] of
    /// [`Session::sounds`], which says more.
    ///
    /// # Errors
    /// As [`SoundInput::push_ears`]: [`ErrorKind::Argument`] where the bundle has no hearing, or for
    /// ears of different lengths; [`ErrorKind::Audio`] for a bad rate or samples that are not
    /// finite.
    pub fn push_ears(&mut self, left: &[f32], right: &[f32], rate: u32) -> Result<()> {
        self.state.inputs.sounds().push_ears(left, right, rate)
    }

    /// Ends what the ears brought at once. The same as [`SoundInput::end_ears`] of
    /// [`Session::sounds`].
    ///
    /// # Errors
    /// As [`SoundInput::end_ears`].
    pub fn end_ears(&mut self) -> Result<()> {
        self.state.inputs.sounds().end_ears()
    }

    /// Where the last block took what stands out among the sounds to be, world metres: the place of
    /// a source, or, of what [`Session::push_ears`] brought, the direction that was estimated, 2 m
    /// away and 1.5 m over the floor. None while nothing is known, two seconds after it has faded.
    pub fn heard_place(&self) -> Option<Vec3> {
        self.state.inputs.heard_place()
    }

    /// The input of sounds in the room, for the threads that have them.
    pub fn sounds(&self) -> SoundInput {
        self.state.inputs.sounds()
    }

    /// A voice's input, for the thread that has its sound: to push, to end an utterance, to break
    /// one off, to set the voice's presence.
    pub fn voice_input(&self, speaker: Speaker) -> VoiceInput {
        self.state.inputs.voice(speaker).clone()
    }

    /// The input of the user's head, for the thread that tracks it.
    pub fn head_input(&self) -> HeadInput {
        self.state.inputs.head().clone()
    }

    /// The settings, for other threads: what is set there holds from the next poll on.
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// The frames of the last block, or `None` before the first.
    pub fn frames(&self) -> Option<&[Frame]> {
        (self.state.block > self.options.diagnostics.first_block).then_some(&self.state.frames)
    }

    /// The kernel's ids of the threads that this session owns and computes on, for performance
    /// hints: the second thread's where there is one. The thread that calls [`Session::poll`]
    /// computes too ([`crate::threads::current_thread_id`]).
    pub fn worker_thread_ids(&self) -> impl Iterator<Item = u32> {
        self.exec.pool().helper_id().into_iter()
    }

    /// Block times, delays and counters so far.
    pub fn stats(&self) -> SessionStats {
        SessionStats {
            blocks: self.state.block - self.options.diagnostics.first_block,
            block_ms: self.times.percentiles(),
            delays: self.state.inputs.delays(&self.engine.config),
            inputs: self.state.inputs.stats(),
            anchorings: self.state.maker.anchorings(),
            governor: self.governor_stats(),
            guard: self.state.motion.guard_stats(),
            cache_bytes: self.state.maker.cache_bytes(),
        }
    }

    /// The engine that this session runs on.
    pub fn engine(&self) -> &Arc<Engine> {
        &self.engine
    }

    /// Current options.
    pub fn options(&self) -> &SessionOptions {
        &self.options
    }
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = &self.engine.config.name;
        f.debug_struct("Session").field("model", name).field("blocks", &self.state.block).finish_non_exhaustive()
    }
}

fn argument(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::Argument, message)
}
