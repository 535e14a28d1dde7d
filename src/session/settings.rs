//! What may be set while a session runs, and the decisions that follow from it.

use super::fallback::Fallback;
use super::governor::{self, Decision, Governor, GovernorStats, Hold, Plan, Policy};
use super::maker::Maker;
use super::{Session, argument, options};
use crate::engine::Engine;
#[cfg(doc)]
use crate::error::ErrorKind;
use crate::error::Result;
use crate::frame::Sampler;
use std::sync::Arc;

impl Session {
    /// Sets the gaze target, -1 to 1 (0 is averted, 1 sustained eye contact), or `None` for free
    /// gaze: levels of recorded conversations, another one every now and then, where the bundle was
    /// calibrated, else what the model finds natural. Takes effect with the next block. The first
    /// target takes the memory of its guidance branch, a copy of some megabytes.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] outside -1 to 1.
    pub fn set_gaze(&mut self, target: Option<f32>) -> Result<()> {
        options::check_gaze(target)?;
        self.controls.settle_gaze();
        self.apply_gaze(target);
        Ok(())
    }

    pub(super) fn apply_gaze(&mut self, target: Option<f32>) {
        if let Some(maker) = self.state.maker.latent().filter(|_| self.options.diagnostics.gaze_control.guides(target))
        {
            maker.generator.open_gaze();
        }
        self.options.gaze = target;
    }

    /// Sets the guidance weights: of the conditioning as a whole (1 is none) and of the gaze
    /// target.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] outside 0 to 20.
    pub fn set_guidance(&mut self, weight: f32, gaze: f32) -> Result<()> {
        options::check_guidance(weight)?;
        options::check_guidance(gaze)?;
        self.controls.settle_guidance();
        (self.options.guidance, self.options.gaze_guidance) = (Some(weight), Some(gaze));
        Ok(())
    }

    /// Sets how readily the agent reacts to sounds in the room, from the next block on
    /// ([`SessionOptions::sensitivity`](crate::SessionOptions::sensitivity)).
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] beyond 1.5 either way.
    pub fn set_sensitivity(&mut self, sensitivity: f32) -> Result<()> {
        options::check_sensitivity(sensitivity)?;
        self.controls.settle_sensitivity();
        self.options.sensitivity = sensitivity;
        Ok(())
    }

    /// Sets the sampler from the next block on; with a governor, the best one that it uses. Without
    /// one, flow times that were not visited lately catch up in batched passes within that block.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when this session has no slots, or the bundle no student, for it.
    pub fn set_sampler(&mut self, sampler: Sampler) -> Result<()> {
        if !self.state.supports(sampler) {
            return Err(options::unsupported(sampler, &self.engine));
        }
        self.controls.settle_sampler();
        self.apply_sampler(sampler);
        Ok(())
    }

    pub(super) fn apply_sampler(&mut self, sampler: Sampler) {
        if sampler != self.options.sampler {
            self.options.sampler = sampler;
            self.renew_policy();
        }
    }

    /// The sampler that was set, here or by [`Session::controls`]; what made a frame is in
    /// [`Frame::sampler`](crate::Frame::sampler).
    pub fn sampler(&self) -> Sampler {
        self.controls.sampler().unwrap_or(self.options.sampler)
    }

    /// Sets who chooses the samplers from the next block on. [`Governor::Off`] pins the session's
    /// sampler.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a budget out of range, or decisions that are not in ascending
    /// order.
    pub fn set_governor(&mut self, governor: Governor) -> Result<()> {
        governor.check()?;
        self.controls.settle_budget();
        self.apply_governor(governor);
        Ok(())
    }

    pub(super) fn apply_governor(&mut self, governor: Governor) {
        self.options.governor = governor;
        self.renew_policy();
    }

    fn renew_policy(&mut self) {
        let stats = self.policy.as_ref().map(Policy::stats);
        self.policy = self.fresh_policy().map(|policy| policy.with_stats(stats.unwrap_or_default()));
        self.last = None;
    }

    /// Gives the session an engine of the kind `dram` to step down to: where blocks of even the
    /// last sampler come late three times in a row, a governor then has this engine make the
    /// motion, instead of holding the pose. Both ways it is a cross-fade of eight frames. Frames
    /// that it made have [`Frame::dyadic`](crate::Frame::dyadic), the others do not;
    /// [`GovernorStats`] counts the blocks. Where it comes late too, the pose is held. Takes
    /// memory; without a governor it changes nothing. A reset keeps it.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where this session's own engine is of the kind `dram`, where
    /// `engine` is not, or where their rigs or delays differ.
    pub fn set_fallback(&mut self, engine: &Arc<Engine>) -> Result<()> {
        if self.engine.sarah().is_err() {
            return Err(argument("a session of the kind `dram` has nothing to fall back from"));
        }
        let fallback = Fallback::new(&self.engine, engine)?;
        let joints = engine.config.rig.len();
        self.state.frames.iter_mut().for_each(|frame| frame.dyadic.reserve(joints));
        if self.state.leave_fallback() {
            self.state.motion.cross_fade();
        }
        self.state.fallback = Some(Box::new(fallback));
        self.renew_policy();
        Ok(())
    }

    /// Tells how long the last block took by the caller's own clock, milliseconds, in place of what
    /// the session measured; the next decision of the governor goes by it. For callers whose
    /// deadline covers more than [`Session::poll`], and for tests with a clock of their own.
    /// Without a block since the last decision it changes nothing.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a time that is not finite or negative.
    pub fn report_block_time(&mut self, milliseconds: f64) -> Result<()> {
        options::check_block_time(milliseconds)?;
        self.controls.settle_block_time();
        self.apply_block_time(milliseconds);
        Ok(())
    }

    pub(super) fn apply_block_time(&mut self, milliseconds: f64) {
        if let Some((_, _, measured)) = &mut self.last {
            *measured = milliseconds;
        }
    }

    /// The decisions of this session, oldest first: each plan that differs from that of the block
    /// before. The last 8192 are kept. They can be replayed ([`Governor::Replay`]).
    pub fn decisions(&self) -> impl Iterator<Item = Decision> + '_ {
        self.log.iter()
    }

    pub(super) fn fresh_policy(&self) -> Option<Policy> {
        let Governor::Budget(budget) = &self.options.governor else { return None };
        Some(match &self.state.maker {
            Maker::Latent(_) => Policy::new(budget, self.options.sampler, self.engine.has_student())
                .with_fallback(self.state.fallback.is_some()),
            Maker::Step(_) => Policy::single(budget, self.options.sampler),
        })
    }

    /// The plan of the next block and its work.
    pub(super) fn plan(&mut self) -> (Plan, f64) {
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
        let outlook = self.state.maker.outlook(policy.ladder(), branches);
        let plan = policy.decide(&outlook);
        let rung = policy.ladder().iter().position(|s| *s == plan.sampler).unwrap_or(0);
        let work = match plan.hold {
            Hold::Yes | Hold::Fallback => 0.0,
            // The fallback's time counts as the rehearsal's: it is short, and its speed another.
            Hold::Rehearse | Hold::RehearseFallback => self.state.maker.rehearsal(plan.sampler, branches),
            Hold::No => {
                let passes = plan.catch_up.map_or(0.0, |(passes, _)| f64::from(passes));
                let anchor = if plan.anchor { outlook.anchor } else { 0.0 };
                outlook.rungs[rung][1] + passes * outlook.pass + anchor
            }
        };
        (plan, work)
    }

    pub(super) fn governor_stats(&self) -> GovernorStats {
        let mut stats = self.policy.as_ref().map(Policy::stats).unwrap_or_default();
        if let (Governor::Budget(budget), Some((_, _, milliseconds))) = (&self.options.governor, &self.last) {
            stats.missed += u64::from(*milliseconds > f64::from(budget.milliseconds));
        }
        stats.forgotten_decisions = self.log.forgotten();
        stats
    }
}
