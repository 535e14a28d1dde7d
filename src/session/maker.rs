//! What makes a session's poses, by the kind of its bundle.

use super::SessionOptions;
use super::by_latent::ByLatent;
use super::by_step::ByStep;
use super::governor::Outlook;
use crate::engine::{Engine, Model};
use crate::error::Result;
use crate::frame::Sampler;
use crate::kernels::Exec;

/// What makes a session's poses.
pub(super) enum Maker {
    /// The flow model: a latent a block.
    Latent(Box<ByLatent>),
    /// The featherweight tier: a step a frame.
    Step(Box<ByStep>),
}

impl Maker {
    pub(super) fn new(exec: &mut Exec, engine: &Engine, options: &SessionOptions) -> Result<Self> {
        Ok(match &engine.model {
            Model::Sarah(sarah) => Self::Latent(Box::new(ByLatent::new(exec, engine, sarah, options)?)),
            Model::Dram(dram) => Self::Step(Box::new(ByStep::new(engine, dram))),
        })
    }

    pub(super) fn latent(&mut self) -> Option<&mut ByLatent> {
        match self {
            Self::Latent(maker) => Some(maker),
            Self::Step(_) => None,
        }
    }

    pub(super) fn step(&mut self) -> Option<&mut ByStep> {
        match self {
            Self::Step(maker) => Some(maker),
            Self::Latent(_) => None,
        }
    }

    /// Whether `sampler` may be set: any where there are no samplers.
    pub(super) fn supports(&self, sampler: Sampler) -> bool {
        match self {
            Self::Latent(maker) => maker.generator.supports(sampler),
            Self::Step(_) => true,
        }
    }

    /// Bytes of caches, or of what the predictors remember.
    pub(super) fn cache_bytes(&self) -> usize {
        match self {
            Self::Latent(maker) => maker.cache_bytes(),
            Self::Step(maker) => maker.state.bytes(),
        }
    }

    pub(super) fn anchorings(&self) -> u64 {
        match self {
            Self::Latent(maker) => maker.anchor.count(),
            Self::Step(_) => 0,
        }
    }

    /// What the next block would cost on each of `ladder`, best first.
    pub(super) fn outlook(&self, ladder: &[Sampler], branches: usize) -> Outlook {
        match self {
            Self::Latent(maker) => maker.outlook(ladder, branches),
            Self::Step(maker) => {
                let mut outlook = Outlook::default();
                outlook.rungs[..ladder.len()].fill([maker.work; 2]);
                outlook
            }
        }
    }

    /// The work of a rehearsal with `sampler`.
    pub(super) fn rehearsal(&self, sampler: Sampler, branches: usize) -> f64 {
        match self {
            Self::Latent(maker) => maker.work.rehearsal(sampler, branches),
            Self::Step(maker) => maker.work,
        }
    }
}
