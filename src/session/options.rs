//! What a session is made with.

use super::diagnostics::{Diagnostics, HistoryTime};
use super::{Governor, argument};
use crate::audio::VOICE_SECONDS;
use crate::config::{CleanHistory, Config};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::flow::Guidance;
use crate::frame::{Root, Sampler};

/// Options of a session.
///
/// Start from `SessionOptions::default()` and change what is needed:
/// `SessionOptions { gaze: Some(0.8), ..Default::default() }`.
///
/// Bundles of the kind `dram` are deterministic and make a frame a step: seed, sampler, guidance and
/// temperature change nothing there, a gaze target is one input among others, and a governor can
/// only hold the pose. The other way round, [`super::Session::set_fallback`] lets a session of the
/// flow model step down to such a bundle.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionOptions {
    /// Seed of the noise: same seed and same inputs, same bits.
    pub seed: u64,
    /// Threads that compute a block, 1 or 2. The result is the same.
    pub threads: usize,
    /// Cores that the second thread may run on (bit i: core i); `None` for any. The first thread is
    /// the caller's own: [`crate::threads::pin_current_thread`].
    pub core_mask: Option<u64>,
    /// Sampler at the start; with a governor, the best one that it uses.
    pub sampler: Sampler,
    /// Who chooses the sampler of each block.
    pub governor: Governor,
    /// Gaze target, -1 to 1 (0 is averted, 1 sustained eye contact), or `None` for free gaze.
    pub gaze: Option<f32>,
    /// Guidance weight, 0 to 20; `None` for the bundle's.
    pub guidance: Option<f32>,
    /// Gaze guidance weight, 0 to 20; `None` for the bundle's.
    pub gaze_guidance: Option<f32>,
    /// Scale of the noise that blocks start from, 0 to 2; `None` for the bundle's. Less gives
    /// calmer motion.
    pub temperature: Option<f32>,
    /// How readily the agent reacts to sounds in the room: -1 dull, 0 neutral, 1 sensitive; numbers
    /// between, and up to 1.5 either way. Bundles without hearing do not go by it.
    pub sensitivity: f32,
    /// Where the agent stands at the start, in the caller's world.
    pub start: Root,
    /// Whether the root's steps are corrected so that planted feet stay where they are.
    pub stance: bool,
    /// Whether frames that no body could show are replaced by a held pose
    /// ([`crate::stats::GuardStats`]); without it a pose that is not finite is an error.
    pub guard: bool,
    /// Seconds of sound that each voice may be ahead of the block that was computed last, 0.5 to 60
    /// (the default); what is more is dropped and counted. A second takes 192 KB for both: a crowd
    /// that hears sound as it comes does with the least.
    pub voice_ahead: f64,
    /// For measurements and tests.
    #[doc(hidden)]
    pub diagnostics: Diagnostics,
}

impl Default for SessionOptions {
    fn default() -> Self {
        Self {
            seed: 0,
            threads: 1,
            core_mask: None,
            sampler: Sampler::Midpoint4,
            governor: Governor::Off,
            gaze: None,
            guidance: None,
            gaze_guidance: None,
            temperature: None,
            sensitivity: 0.0,
            start: Root::default(),
            stance: true,
            guard: true,
            voice_ahead: VOICE_SECONDS,
            diagnostics: Diagnostics::default(),
        }
    }
}

impl SessionOptions {
    pub(super) fn check(&self, engine: &Engine) -> Result<()> {
        check_gaze(self.gaze)?;
        [self.guidance, self.gaze_guidance].into_iter().flatten().try_for_each(check_guidance)?;
        if let Some(t) = self.temperature.filter(|t| !(0.0..=2.0).contains(t)) {
            return Err(argument(format!("temperature {t}: 0 to 2")));
        }
        check_sensitivity(self.sensitivity)?;
        if !matches!(self.threads, 1 | 2) {
            return Err(argument(format!("threads is {}: 1 or 2", self.threads)));
        }
        if [self.start.x, self.start.z, self.start.yaw].iter().any(|v| !v.is_finite() || v.abs() > 1e6) {
            return Err(argument("start: x, z and yaw must be finite and within a million metres"));
        }
        if !(0.5..=VOICE_SECONDS).contains(&self.voice_ahead) {
            return Err(argument(format!("voice_ahead is {} s: 0.5 to {VOICE_SECONDS}", self.voice_ahead)));
        }
        self.diagnostics.check()?;
        self.governor.check()?;
        let Ok(sarah) = engine.sarah() else { return Ok(()) };
        match self.sampler {
            Sampler::Single if sarah.student.is_some() => Ok(()),
            Sampler::Single => Err(unsupported(Sampler::Single, engine)),
            _ if sarah.flow.is_some() => Ok(()),
            other => Err(unsupported(other, engine)),
        }
    }

    /// Of a block that `sampler` makes.
    pub(super) fn temperature(&self, config: &Config, sampler: Sampler) -> f32 {
        let student = config.student.filter(|_| sampler == Sampler::Single).and_then(|student| student.temperature);
        self.temperature.or(student).unwrap_or(config.session.temperature)
    }

    pub(super) fn clean_history(&self, engine: &Engine) -> Option<CleanHistory> {
        match self.diagnostics.history {
            HistoryTime::Bundle => engine.config.session.clean_history,
            HistoryTime::Imputed => None,
            HistoryTime::Clean(c) => Some(c),
        }
    }

    /// Weights of a block in which what is heard calls for a reaction by `reaction`, 0 to 1.
    pub(super) fn guidance(&self, engine: &Engine, reaction: f32) -> Guidance {
        let defaults = &engine.config.session;
        let weights = Guidance {
            weight: self.guidance.unwrap_or(defaults.guidance),
            gaze: self.gaze_guidance.unwrap_or(defaults.gaze_guidance),
        };
        engine.config.hearing.as_ref().map_or(weights, |hearing| weights.reacting(reaction, hearing.guidance))
    }
}

pub(super) fn check_gaze(target: Option<f32>) -> Result<()> {
    match target {
        Some(g) if !(-1.0..=1.0).contains(&g) => Err(argument(format!("gaze target {g}: -1 to 1, or none"))),
        _ => Ok(()),
    }
}

pub(super) fn check_sensitivity(sensitivity: f32) -> Result<()> {
    if sensitivity.abs() <= 1.5 {
        return Ok(());
    }
    Err(argument(format!("sensitivity {sensitivity}: -1 (dull) to 1 (sensitive), at most 1.5 either way")))
}

pub(super) fn check_guidance(weight: f32) -> Result<()> {
    if (0.0..=20.0).contains(&weight) {
        return Ok(());
    }
    Err(argument(format!("guidance weight {weight}: 0 to 20")))
}

pub(super) fn check_block_time(milliseconds: f64) -> Result<()> {
    if milliseconds.is_finite() && milliseconds >= 0.0 {
        return Ok(());
    }
    Err(argument(format!("a block time of {milliseconds} ms: 0 or more")))
}

pub(super) fn unsupported(sampler: Sampler, engine: &Engine) -> Error {
    argument(match sampler {
        Sampler::Single if !engine.has_student() && engine.config.student.is_some() => {
            "the single-step sampler needs the student network, which this engine was loaded without".to_owned()
        }
        Sampler::Single if !engine.has_student() => {
            "the single-step sampler needs a bundle with a student network; this one has none (see `visavis inspect`)"
                .to_owned()
        }
        _ if engine.sarah().is_ok_and(|sarah| sarah.flow.is_none()) => {
            format!("{sampler} needs the reference network, which this engine was loaded without: use the single step")
        }
        _ => format!("{sampler}: its flow times have no caches in this session; make a session with that sampler"),
    })
}
