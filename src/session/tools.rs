//! What blocks are computed with.

use crate::engine::Engine;
use crate::flow;
use crate::kernels::Exec;
use crate::vae::{self, Decoding};

/// Working memory of blocks: nothing in it outlives a block.
#[derive(Debug)]
pub(super) struct Workspace {
    pub(super) flow: flow::Work,
    pub(super) vae: vae::Work,
}

impl Workspace {
    /// For up to `blocks` blocks at once.
    pub(super) fn new(engine: &Engine, blocks: usize) -> Self {
        Self { flow: flow::Work::new(engine.nets().any()), vae: engine.decoder.work(blocks) }
    }
}

/// Threads, working memory and weights.
pub(super) struct Tools<'a> {
    pub(super) exec: &'a mut Exec,
    pub(super) work: &'a mut Workspace,
    pub(super) engine: &'a Engine,
}

impl Tools<'_> {
    /// What generators need of them.
    pub(super) fn flow(&mut self) -> flow::Tools<'_> {
        flow::Tools { exec: self.exec, work: &mut self.work.flow, nets: self.engine.nets() }
    }

    /// Decodes a block.
    pub(super) fn decode(&mut self, block: Decoding<'_>) {
        self.engine.decoder.step(self.exec, &mut self.work.vae, block);
    }
}
