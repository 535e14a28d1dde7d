//! From session time to blocks.

use super::Session;
use super::block::Block;
use super::governor::Plan;
use super::noise::Noise;
use super::pipeline;
use super::probe::Probe;
use super::tools::Tools;
use crate::clock::Instant;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, FPS, Frame};
use crate::normaliser::Standardised;
use std::time::Duration;

impl Session {
    /// Computes the next block if it is due at `now` (session time, seconds) and returns its four
    /// frames, or `None`. Call it until it returns `None`; a caller that comes late gets all blocks
    /// that it missed.
    ///
    /// Block `k` is due at `4 k / 30` s. It has heard and seen the user up to then, and the agent's
    /// voice through its own four frames.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a time that is not finite, [`ErrorKind::State`] for one before
    /// an earlier call's.
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
        let Self { exec, work: memory, engine, options, state, .. } = self;
        let probe = probe.map(|probe| probe as _);
        let mut blocks = [Some(Block { options, plan, state, probe, outcome: Ok(()) })];
        exec.begin();
        pipeline::compute(&mut Tools { exec, work: memory, engine }, &mut blocks);
        exec.end();
        let [block] = blocks;
        let outcome = block.map_or(Ok(()), |block| block.outcome);
        self.ended(plan, work, started.elapsed());
        outcome.map(|()| Some(self.state.frames.as_slice()))
    }

    /// Sets the time, takes notice of what came from other threads; whether a block is due.
    pub(super) fn is_due(&mut self, now: f64) -> Result<bool> {
        self.check_time(now)?;
        self.now = now;
        self.take_notice();
        Ok(now >= self.next_due() - 1e-9)
    }

    pub(super) fn check_time(&self, now: f64) -> Result<()> {
        if !now.is_finite() {
            return Err(Error::new(ErrorKind::Argument, format!("poll at {now}: pass seconds of session time")));
        }
        if now < self.now {
            let message = format!("poll at {now} s after {} s: session time does not run backwards", self.now);
            return Err(Error::new(ErrorKind::State, message));
        }
        Ok(())
    }

    /// Decides about the next block, which is due: its plan and its work.
    pub(super) fn start(&mut self) -> (Plan, f64) {
        let root = self.state.motion.root();
        self.state.inputs.look_for_sounds(self.state.block, &root);
        let (plan, work) = self.plan();
        self.log.record(self.state.block, plan);
        (plan, work)
    }

    /// Remembers what the block took.
    pub(super) fn ended(&mut self, plan: Plan, work: f64, elapsed: Duration) {
        self.times.record(elapsed);
        self.last = Some((plan, work, 1000.0 * elapsed.as_secs_f64()));
    }

    /// Session time at which the next block is due, seconds.
    pub fn next_due(&self) -> f64 {
        (self.state.block * BLOCK_FRAMES as u64) as f64 / f64::from(FPS)
    }

    /// Starts anew, as if just made with the current options: same seed, same bits. Time starts at
    /// 0 again. What was pushed before is dropped.
    ///
    /// # Errors
    /// None that the session's creation would not have met.
    pub fn reset(&mut self) -> Result<()> {
        self.take_notice();
        self.forget();
        let mut tools = Tools { exec: &mut self.exec, work: &mut self.work, engine: &self.engine };
        let idle = self.engine.sarah().map_or(Standardised::new(&[][..]), |sarah| sarah.idle.view());
        self.state.reset(&mut tools, &self.options, idle);
        Ok(())
    }

    /// Takes notice of what was set before; forgets times and decisions.
    pub(super) fn forget(&mut self) {
        self.take_notice();
        self.now = 0.0;
        self.times.clear();
        self.log.clear();
        self.policy = self.fresh_policy();
        self.last = None;
    }

    /// Computes `blocks` blocks for nothing and starts anew, so that pages, caches and the CPU's
    /// clock are warm when the first real block is due. What was pushed before is dropped.
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

    /// Replaces the seeded noise of the coming tokens: `noise` holds `[tokens, latent]` values, for
    /// the idle clip's tokens first. Starts the session anew. For parity checks against other
    /// implementations.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when there are fewer tokens than the idle clip has, or none at all.
    #[doc(hidden)]
    pub fn reset_with_noise(&mut self, noise: Vec<f32>) -> Result<()> {
        let latent = self.engine.config.vae.latent;
        if noise.len() < self.engine.sarah()?.idle.values().len() || !noise.len().is_multiple_of(latent) {
            let message = format!("noise of {} values: whole tokens of {latent}, idle clip included", noise.len());
            return Err(Error::new(ErrorKind::Argument, message));
        }
        if let Some(maker) = self.state.maker.latent() {
            maker.noise = Noise::Given(noise);
        }
        self.reset()
    }
}
