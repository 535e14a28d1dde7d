//! What blocks are computed with.

use crate::config::Config;
use crate::dram::{self, Dram};
use crate::engine::{Engine, Model, Sarah};
use crate::flow;
use crate::kernels::Exec;
use crate::vae::{self, Decoding};

/// Working memory of blocks: nothing in it outlives a block.
#[derive(Debug)]
pub(super) enum Workspace {
    /// Of the flow model.
    Sarah {
        /// Its passes.
        flow: Box<flow::Work>,
        /// Its decoder's.
        vae: Box<vae::Work>,
    },
    /// Of the featherweight tier.
    Dram(dram::Work),
}

impl Workspace {
    /// For up to `blocks` blocks at once, of the flow model up to `latents`.
    pub(super) fn new(engine: &Engine, blocks: usize, latents: usize) -> Self {
        match &engine.model {
            Model::Sarah(sarah) => {
                let flow = Box::new(flow::Work::new(sarah.nets().any()));
                Self::Sarah { flow, vae: Box::new(sarah.decoder.work(latents)) }
            }
            Model::Dram(dram) => Self::Dram(dram.work(blocks)),
        }
    }
}

/// Threads, working memory and weights.
pub(super) struct Tools<'a> {
    pub(super) exec: &'a mut Exec,
    pub(super) work: &'a mut Workspace,
    pub(super) engine: &'a Engine,
}

/// The same, by the kind of the bundle.
pub(super) enum Kit<'a> {
    Sarah(SarahTools<'a>),
    Dram(DramTools<'a>),
}

/// Tools of the flow model.
pub(super) struct SarahTools<'a> {
    pub(super) exec: &'a mut Exec,
    pub(super) flow: &'a mut flow::Work,
    pub(super) vae: &'a mut vae::Work,
    pub(super) model: &'a Sarah,
    pub(super) config: &'a Config,
}

/// Tools of the featherweight tier.
pub(super) struct DramTools<'a> {
    pub(super) exec: &'a mut Exec,
    pub(super) work: &'a mut dram::Work,
    pub(super) model: &'a Dram,
}

impl Tools<'_> {
    /// Those of the bundle's kind.
    ///
    /// # Panics
    /// When the working memory is another engine's.
    pub(super) fn kit(&mut self) -> Kit<'_> {
        let (exec, config) = (&mut *self.exec, &self.engine.config);
        match (&self.engine.model, &mut *self.work) {
            (Model::Sarah(model), Workspace::Sarah { flow, vae }) => {
                Kit::Sarah(SarahTools { exec, flow, vae, model, config })
            }
            (Model::Dram(model), Workspace::Dram(work)) => Kit::Dram(DramTools { exec, work, model }),
            _ => unreachable!("working memory is made for its engine"),
        }
    }
}

impl SarahTools<'_> {
    /// What generators need of them.
    pub(super) fn flow(&mut self) -> flow::Tools<'_> {
        flow::Tools { exec: self.exec, work: self.flow, nets: self.model.nets() }
    }

    /// Decodes a block.
    pub(super) fn decode(&mut self, block: Decoding<'_>) {
        self.model.decoder.step(self.exec, self.vae, block);
    }
}
