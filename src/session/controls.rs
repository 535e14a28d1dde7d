//! Settings of a session from threads that do not own it.

use super::options::{check_block_time, check_gaze, check_guidance, check_sensitivity, unsupported};
use super::{Governor, Session};
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{EulerSteps, Sampler};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

/// Sets what a session goes by, from any thread, also while that session computes a block.
///
/// Nothing here waits or allocates. What is set holds from the next block on, as with the session's
/// own methods of these names; of each setting the last one counts.
#[derive(Debug, Clone)]
pub struct Controls {
    engine: Arc<Engine>,
    pending: Arc<Pending>,
}

/// What was set and not yet taken notice of.
#[derive(Debug)]
struct Pending {
    /// Bits of the target, or [`FREE`].
    gaze: Setting,
    /// Bits of both weights.
    guidance: Setting,
    /// Bits of the sensitivity.
    sensitivity: Setting,
    /// Place among `samplers`.
    sampler: Setting,
    /// Bits of the milliseconds.
    budget: Setting,
    /// Bits of the milliseconds.
    block_time: Setting,
    /// Those that the session has slots for.
    samplers: Vec<Sampler>,
}

/// No gaze target: no bits of an f32.
const FREE: u64 = 1 << 32;

/// One word, or none: all ones, which are the bits of no number that is accepted.
#[derive(Debug)]
struct Setting(AtomicU64);

impl Setting {
    const NONE: u64 = u64::MAX;

    fn new() -> Self {
        Self(AtomicU64::new(Self::NONE))
    }

    // Relaxed: the word is all there is.
    fn set(&self, word: u64) {
        self.0.store(word, Relaxed);
    }

    fn get(&self) -> Option<u64> {
        Some(self.0.load(Relaxed)).filter(|word| *word != Self::NONE)
    }

    fn take(&self) -> Option<u64> {
        // Most of the time there is none.
        self.get()?;
        Some(self.0.swap(Self::NONE, Relaxed)).filter(|word| *word != Self::NONE)
    }
}

impl Controls {
    pub(super) fn new(engine: &Arc<Engine>, supports: impl Fn(Sampler) -> bool) -> Self {
        let midpoint = [Sampler::Midpoint4, Sampler::Midpoint2, Sampler::Midpoint1, Sampler::Single];
        let euler = (1..=EulerSteps::MAX).filter_map(EulerSteps::new).map(Sampler::Euler);
        let all = midpoint.into_iter().chain(euler);
        let pending = Pending {
            gaze: Setting::new(),
            guidance: Setting::new(),
            sensitivity: Setting::new(),
            sampler: Setting::new(),
            budget: Setting::new(),
            block_time: Setting::new(),
            samplers: all.filter(|sampler| supports(*sampler)).collect(),
        };
        Self { engine: Arc::clone(engine), pending: Arc::new(pending) }
    }

    /// As [`Session::set_gaze`]. The copy that the first target makes is made by the next poll.
    ///
    /// # Errors
    /// As [`Session::set_gaze`].
    pub fn set_gaze(&self, target: Option<f32>) -> Result<()> {
        check_gaze(target)?;
        self.pending.gaze.set(target.map_or(FREE, |target| u64::from(target.to_bits())));
        Ok(())
    }

    /// As [`Session::set_guidance`].
    ///
    /// # Errors
    /// As [`Session::set_guidance`].
    pub fn set_guidance(&self, weight: f32, gaze: f32) -> Result<()> {
        check_guidance(weight)?;
        check_guidance(gaze)?;
        self.pending.guidance.set(u64::from(weight.to_bits()) << 32 | u64::from(gaze.to_bits()));
        Ok(())
    }

    /// As [`Session::set_sensitivity`].
    ///
    /// # Errors
    /// As [`Session::set_sensitivity`].
    pub fn set_sensitivity(&self, sensitivity: f32) -> Result<()> {
        check_sensitivity(sensitivity)?;
        self.pending.sensitivity.set(u64::from(sensitivity.to_bits()));
        Ok(())
    }

    /// As [`Session::set_sampler`].
    ///
    /// # Errors
    /// As [`Session::set_sampler`].
    pub fn set_sampler(&self, sampler: Sampler) -> Result<()> {
        let place = self.pending.samplers.iter().position(|s| *s == sampler);
        self.pending.sampler.set(place.ok_or_else(|| unsupported(sampler, &self.engine))? as u64);
        Ok(())
    }

    /// As [`Session::set_governor`] with [`Governor::within`]: milliseconds that a block may take,
    /// 1 to 133.3, or 0 for the session's sampler, always.
    ///
    /// # Errors
    /// As [`Session::set_governor`].
    pub fn set_budget(&self, milliseconds: f32) -> Result<()> {
        Governor::within(milliseconds).check()?;
        self.pending.budget.set(u64::from(milliseconds.to_bits()));
        Ok(())
    }

    /// As [`Session::report_block_time`].
    ///
    /// # Errors
    /// As [`Session::report_block_time`].
    pub fn report_block_time(&self, milliseconds: f64) -> Result<()> {
        check_block_time(milliseconds)?;
        self.pending.block_time.set(milliseconds.to_bits());
        Ok(())
    }

    /// The sampler that was set and not yet taken notice of.
    pub(super) fn sampler(&self) -> Option<Sampler> {
        self.pending.sampler.get().and_then(|place| self.pending.samplers.get(place as usize).copied())
    }

    // What the session's owner sets replaces what is pending.

    pub(super) fn settle_gaze(&self) {
        self.pending.gaze.take();
    }

    pub(super) fn settle_guidance(&self) {
        self.pending.guidance.take();
    }

    pub(super) fn settle_sensitivity(&self) {
        self.pending.sensitivity.take();
    }

    pub(super) fn settle_sampler(&self) {
        self.pending.sampler.take();
    }

    pub(super) fn settle_budget(&self) {
        self.pending.budget.take();
    }

    pub(super) fn settle_block_time(&self) {
        self.pending.block_time.take();
    }
}

impl Session {
    /// Takes notice of what other threads pushed and set: the coming block goes by that.
    pub(super) fn take_notice(&mut self) {
        self.state.inputs.look();
        // All were checked when they were set.
        let pending = Arc::clone(&self.controls.pending);
        if let Some(word) = pending.block_time.take() {
            self.apply_block_time(f64::from_bits(word));
        }
        if let Some(word) = pending.gaze.take() {
            self.apply_gaze((word != FREE).then(|| f32::from_bits(word as u32)));
        }
        if let Some(word) = pending.guidance.take() {
            let weights = (f32::from_bits((word >> 32) as u32), f32::from_bits(word as u32));
            (self.options.guidance, self.options.gaze_guidance) = (Some(weights.0), Some(weights.1));
        }
        if let Some(word) = pending.sensitivity.take() {
            self.options.sensitivity = f32::from_bits(word as u32);
        }
        if let Some(place) = pending.sampler.take() {
            self.apply_sampler(pending.samplers[place as usize]);
        }
        if let Some(word) = pending.budget.take() {
            self.apply_governor(Governor::within(f32::from_bits(word as u32)));
        }
    }
}
