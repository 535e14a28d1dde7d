//! Sessions: one conversation with one user. The one place that knows all stages.
//!
//! ```text
//! push audio, head -> inputs -> condition -> generator -> latent -> decoder -> features -> motion -> frames -> poll
//! ```
//!
//! | file | what |
//! |---|---|
//! | `options` | what a session is made with |
//! | `diagnostics` | what measurements and tests change about it |
//! | `inputs` | voices and head positions to the conditioning of a block |
//! | `gaze` | the wanted gaze to the gaze channel, free gaze included |
//! | `block` | the computation of a block |
//! | `anchor` | re-anchoring: encoding recent motion anew, spread over blocks |
//! | `governor/` | quality traded for time, block by block |
//! | `team` | several sessions stepped together |
//! | `stats` | block times and counters |
//! | `probe` | every stage of a block, for whoever wants to check the maths |
//!
//! After [`Session::poll`] has been called once, computing a block allocates nothing, takes no lock and makes no system
//! call. The exceptions are outside the block: the first push of a voice, or a change of its rate, makes a resampler.

mod anchor;
mod block;
mod diagnostics;
mod gaze;
mod governor;
mod inputs;
mod options;
mod probe;
mod stats;
mod team;

pub use diagnostics::{Anchoring, Diagnostics, HistoryTime};
pub use gaze::GazeControl;
pub use governor::{Budget, Decision, Governor, GovernorStats, Hold, Plan};
pub use options::SessionOptions;
pub use probe::Probe;
pub use stats::{Delays, InputStats, SessionStats};
pub use team::Team;

use crate::audio::Voice;
use crate::engine::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, FPS, Frame, Sampler};
use crate::kernels::Exec;
use block::BlockState;
use glam::Vec3;
use governor::{Log, Policy};
use std::sync::Arc;
use std::time::{Duration, Instant};

impl Engine {
    /// Starts a session; all memory that it will need is taken here.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when an option is out of range or the bundle cannot do it.
    pub fn session(self: &Arc<Self>, options: SessionOptions) -> Result<Session> {
        Session::new(Arc::clone(self), options)
    }

    /// What it takes to step several sessions of this engine together, on `threads` threads (1 or 2): [`Team`] tells how.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another number of threads; [`ErrorKind::Io`] when the second one cannot be started.
    pub fn team(self: &Arc<Self>, threads: usize) -> Result<Team> {
        Team::new(Arc::clone(self), threads)
    }
}

/// All mutable state of one conversation.
///
/// Time is the caller's: seconds since the session started, the same clock for [`Session::push_user_head`] and
/// [`Session::poll`]. Audio has no timestamps: each voice is one continuous stream that starts at time 0.
pub struct Session {
    engine: Arc<Engine>,
    options: SessionOptions,
    exec: Exec,
    state: BlockState,
    now: f64,
    times: stats::BlockTimes,
    policy: Option<Policy>,
    log: Log,
    /// The last block, until the next decision: its plan, its work, and the milliseconds that it took.
    last: Option<(Plan, f64, f64)>,
    /// In the hands of a team: the block that is due, and the one that is computed.
    due: Option<team::Due>,
    done: Option<team::Due>,
}

impl Session {
    pub(crate) fn new(engine: Arc<Engine>, options: SessionOptions) -> Result<Self> {
        options.check(&engine)?;
        let mut exec = engine.exec(options.threads)?;
        options.core_mask.map_or(Ok(()), |mask| exec.pool().pin_helper(mask))?;
        let state = BlockState::new(&mut exec, &engine, &options)?;
        let times = stats::BlockTimes::new();
        let (log, policy, last) = (Log::new(), None, None);
        let mut session =
            Self { engine, options, exec, state, now: 0.0, times, policy, log, last, due: None, done: None };
        session.policy = session.fresh_policy();
        Ok(session)
    }

    fn fresh_policy(&self) -> Option<Policy> {
        let Governor::Budget(budget) = &self.options.governor else { return None };
        Some(Policy::new(budget, self.options.sampler, self.engine.student.is_some()))
    }

    /// Appends to the agent's own voice: mono samples, full scale 1, any rate from 8 to 192 kHz.
    ///
    /// The voice may come ahead of time (text-to-speech does) by up to a minute. Sound that has not come when a block is
    /// computed is silence there, is counted, and is heard later. A voice that has never been pushed is absent,
    /// which is not the same as silent.
    ///
    /// # Errors
    /// [`ErrorKind::Audio`] for a bad rate or samples that are not finite; nothing of the push is taken.
    pub fn push_agent_audio(&mut self, samples: &[f32], rate: u32) -> Result<()> {
        self.state.inputs.agent_voice().push(samples, rate)
    }

    /// Appends to the user's voice; as [`Session::push_agent_audio`].
    ///
    /// # Errors
    /// As [`Session::push_agent_audio`].
    pub fn push_user_audio(&mut self, samples: &[f32], rate: u32) -> Result<()> {
        self.state.inputs.user_voice().push(samples, rate)
    }

    /// The agent's voice, to end an utterance, to break one off, or to set its presence.
    pub fn agent_voice(&mut self) -> &mut Voice {
        self.state.inputs.agent_voice()
    }

    /// The user's voice, likewise.
    pub fn user_voice(&mut self) -> &mut Voice {
        self.state.inputs.user_voice()
    }

    /// Tells where the user's head is (midpoint of the eyes), world metres, at `time` seconds of session time.
    ///
    /// Any rate; positions that are not finite, out of order, or impossible are ignored and counted (see
    /// [`Session::stats`]).
    ///
    /// # Errors
    /// None today; the result leaves room for typed refusals.
    pub fn push_user_head(&mut self, position: Vec3, time: f64) -> Result<()> {
        self.state.inputs.push_head(position, time);
        Ok(())
    }

    /// Sets the gaze target, 0 (averted) to 1 (sustained eye contact), or `None` for free gaze: levels of recorded conversations,
    /// another one every now and then, where the bundle was calibrated, else what the model finds natural.
    /// Takes effect with the next block. The first target takes the memory of its guidance branch, a copy of some megabytes.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] outside -1 to 1.
    pub fn set_gaze(&mut self, target: Option<f32>) -> Result<()> {
        options::check_gaze(target)?;
        if self.options.diagnostics.gaze_control.guides(target) {
            self.state.generator.open_gaze();
        }
        self.options.gaze = target;
        Ok(())
    }

    /// Sets the guidance weights: of the conditioning as a whole (1 is none) and of the gaze target.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] outside 0 to 20.
    pub fn set_guidance(&mut self, weight: f32, gaze: f32) -> Result<()> {
        options::check_guidance(weight)?;
        options::check_guidance(gaze)?;
        (self.options.guidance, self.options.gaze_guidance) = (Some(weight), Some(gaze));
        Ok(())
    }

    /// Sets the sampler from the next block on; with a governor, the best one that it uses. Without one, flow times that were
    /// not visited lately catch up in batched passes within that block.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when this session has no slots, or the bundle no student, for it.
    pub fn set_sampler(&mut self, sampler: Sampler) -> Result<()> {
        if !self.state.supports(sampler) {
            return Err(options::unsupported(sampler, &self.engine));
        }
        if sampler != self.options.sampler {
            self.options.sampler = sampler;
            self.renew_policy();
        }
        Ok(())
    }

    /// The sampler that was set; what made a frame is in [`Frame::sampler`].
    pub fn sampler(&self) -> Sampler {
        self.options.sampler
    }

    /// Sets who chooses the samplers from the next block on. [`Governor::Off`] pins the session's sampler.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a budget out of range, or decisions that are not in ascending order.
    pub fn set_governor(&mut self, governor: Governor) -> Result<()> {
        governor.check()?;
        self.options.governor = governor;
        self.renew_policy();
        Ok(())
    }

    fn renew_policy(&mut self) {
        let stats = self.policy.as_ref().map(Policy::stats);
        self.policy = self.fresh_policy().map(|policy| policy.with_stats(stats.unwrap_or_default()));
        self.last = None;
    }

    /// Tells how long the last block took by the caller's own clock, milliseconds, in place of what the session measured; the
    /// next decision of the governor goes by it. For callers whose deadline covers more than [`Session::poll`], and for
    /// tests with a clock of their own. Without a block since the last decision it changes nothing.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a time that is not finite or negative.
    pub fn report_block_time(&mut self, milliseconds: f64) -> Result<()> {
        if !(milliseconds.is_finite() && milliseconds >= 0.0) {
            return Err(Error::new(ErrorKind::Argument, format!("a block time of {milliseconds} ms: 0 or more")));
        }
        if let Some((_, _, measured)) = &mut self.last {
            *measured = milliseconds;
        }
        Ok(())
    }

    /// The decisions of this session, oldest first: each plan that differs from that of the block before. The last 8192 are
    /// kept. They can be replayed ([`Governor::Replay`]).
    pub fn decisions(&self) -> impl Iterator<Item = Decision> + '_ {
        self.log.iter()
    }

    /// The plan of the next block and its work.
    fn plan(&mut self) -> (Plan, f64) {
        let pinned = Plan::pinned(self.options.sampler);
        let Some(policy) = &mut self.policy else {
            let Governor::Replay(list) = &self.options.governor else { return (pinned, 0.0) };
            let plan = governor::replayed(list, self.state.block).filter(|plan| self.state.supports(plan.sampler));
            return (plan.unwrap_or(pinned), 0.0);
        };
        if let Some((plan, work, milliseconds)) = self.last.take() {
            policy.observe(&plan, milliseconds, work);
        }
        let branches = if self.options.diagnostics.gaze_control.guides(self.options.gaze) { 3 } else { 2 };
        let outlook = self.state.outlook(policy.ladder(), branches);
        let plan = policy.decide(&outlook);
        let rung = policy.ladder().iter().position(|s| *s == plan.sampler).unwrap_or(0);
        let work = match plan.hold {
            Hold::Yes => 0.0,
            Hold::Rehearse => self.state.work.rehearsal(plan.sampler, branches),
            Hold::No => {
                let passes = plan.catch_up.map_or(0.0, |(passes, _)| f64::from(passes));
                let anchor = if plan.anchor { outlook.anchor } else { 0.0 };
                outlook.rungs[rung][1] + passes * outlook.pass + anchor
            }
        };
        (plan, work)
    }

    /// Computes the next block if it is due at `now` (session time, seconds) and returns its four frames, or `None`.
    /// Call it until it returns `None`; a caller that comes late gets all blocks that it missed.
    ///
    /// Block `k` is due at `4 k / 30` s. It has heard and seen the user up to then, and the agent's voice through its
    /// own four frames.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a time that is not finite, [`ErrorKind::State`] for one before an earlier call's.
    pub fn poll(&mut self, now: f64) -> Result<Option<&[Frame]>> {
        self.poll_with(now, None)
    }

    /// As [`Session::poll`], handing every stage of the block to `probe` as well.
    ///
    /// # Errors
    /// As [`Session::poll`].
    #[doc(hidden)]
    pub fn poll_with(&mut self, now: f64, probe: Option<&mut dyn Probe>) -> Result<Option<&[Frame]>> {
        if !self.is_due(now)? {
            return Ok(None);
        }
        let (plan, work) = self.start();
        let started = Instant::now();
        self.exec.begin();
        let done = self.state.compute(&mut self.exec, &self.engine, &self.options, &plan, probe);
        self.exec.end();
        self.ended(plan, work, started.elapsed());
        done?;
        Ok(Some(&self.state.frames))
    }

    /// Sets the time; whether a block is due.
    fn is_due(&mut self, now: f64) -> Result<bool> {
        self.check_time(now)?;
        self.now = now;
        Ok(now >= self.next_due() - 1e-9)
    }

    fn check_time(&self, now: f64) -> Result<()> {
        if !now.is_finite() {
            return Err(Error::new(ErrorKind::Argument, format!("poll at {now}: pass seconds of session time")));
        }
        if now < self.now {
            let message = format!("poll at {now} s after {} s: session time does not run backwards", self.now);
            return Err(Error::new(ErrorKind::State, message));
        }
        Ok(())
    }

    /// Decides about the next block: its plan and its work.
    fn start(&mut self) -> (Plan, f64) {
        let (plan, work) = self.plan();
        self.log.record(self.state.block, plan);
        (plan, work)
    }

    /// Remembers what the block took.
    fn ended(&mut self, plan: Plan, work: f64, elapsed: Duration) {
        self.times.record(elapsed);
        self.last = Some((plan, work, 1000.0 * elapsed.as_secs_f64()));
    }

    /// The frames of the last block, or `None` before the first.
    pub fn frames(&self) -> Option<&[Frame]> {
        (self.state.block > self.options.diagnostics.first_block).then_some(&self.state.frames)
    }

    /// Session time at which the next block is due, seconds.
    pub fn next_due(&self) -> f64 {
        (self.state.block * BLOCK_FRAMES as u64) as f64 / f64::from(FPS)
    }

    /// Starts anew, as if just made with the current options: same seed, same bits. Time starts at 0 again.
    ///
    /// # Errors
    /// None that the session's creation would not have met.
    pub fn reset(&mut self) -> Result<()> {
        self.now = 0.0;
        self.times.clear();
        self.log.clear();
        self.policy = self.fresh_policy();
        self.last = None;
        self.state.reset(&mut self.exec, &self.engine, &self.options)
    }

    /// Computes `blocks` blocks for nothing and starts anew, so that pages, caches and the CPU's clock are warm when the
    /// first real block is due. What was pushed before is dropped.
    ///
    /// # Errors
    /// As [`Session::poll`] and [`Session::reset`].
    pub fn warm_up(&mut self, blocks: u32) -> Result<()> {
        self.reset()?;
        for _ in 0..blocks {
            self.poll(self.next_due())?;
        }
        self.reset()
    }

    /// The kernel's ids of the threads that this session owns and computes on, for performance hints: the second
    /// thread's where there is one. The thread that calls [`Session::poll`] computes too ([`crate::threads::current_thread_id`]).
    pub fn worker_thread_ids(&self) -> impl Iterator<Item = u32> {
        self.exec.pool().helper_id().into_iter()
    }

    /// Replaces the seeded noise of the coming tokens: `noise` holds `[tokens, latent]` values, for the idle clip's
    /// tokens first. Starts the session anew. For parity checks against other implementations.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when there are fewer tokens than the idle clip has.
    #[doc(hidden)]
    pub fn reset_with_noise(&mut self, noise: Vec<f32>) -> Result<()> {
        let latent = self.engine.config.vae.latent;
        if noise.len() < self.engine.idle.len() || !noise.len().is_multiple_of(latent) {
            let message = format!("noise of {} values: whole tokens of {latent}, idle clip included", noise.len());
            return Err(Error::new(ErrorKind::Argument, message));
        }
        self.state.noise = block::Noise::Given(noise);
        self.reset()
    }

    /// Block times, delays and counters so far.
    pub fn stats(&self) -> SessionStats {
        SessionStats {
            blocks: self.state.block - self.options.diagnostics.first_block,
            block_ms: self.times.percentiles(),
            delays: self.state.inputs.delays(&self.engine.config),
            inputs: self.state.inputs.stats(),
            anchorings: self.state.anchor.count(),
            governor: self.governor_stats(),
            guard: self.state.motion.guard_stats(),
            cache_bytes: self.state.cache_bytes(),
        }
    }

    fn governor_stats(&self) -> GovernorStats {
        let mut stats = self.policy.as_ref().map(Policy::stats).unwrap_or_default();
        if let (Governor::Budget(budget), Some((_, _, milliseconds))) = (&self.options.governor, &self.last) {
            stats.missed += u64::from(*milliseconds > f64::from(budget.milliseconds));
        }
        stats.forgotten_decisions = self.log.forgotten();
        stats
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
