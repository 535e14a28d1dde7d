//! What a teacher does to a session: it listens to the layers, and puts another session's block in
//! the place of the one just made, so that the next one is made from that past. For the quantiser
//! and the accuracy report; nothing of it is public.

use super::Session;
use super::maker::Maker;
use super::options::SessionOptions;
use super::state::BlockState;
use super::tools::{Kit, Tools};
use crate::dram::State;
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::Frame;
use crate::kernels::Activations;
use crate::normaliser::Standardised;
use crate::pose;
use std::sync::Arc;

/// A block as a session made it, and how its motion stood afterwards.
#[derive(Debug, Clone)]
pub(crate) struct MadeBlock {
    /// The latent; of the kind `dram` none.
    pub(crate) z: Standardised,
    /// The features as decoded, `[4, features]`; of the kind `dram` none.
    pub(crate) features: Standardised,
    /// What the predictors of the kind `dram` remember.
    step: Option<State>,
    /// The frames.
    pub(crate) frames: Vec<Frame>,
    motion: pose::Decoder,
}

impl MadeBlock {
    /// What the network made: the latent, or the poses.
    pub(crate) fn output(&self) -> &[f32] {
        self.step.as_ref().map_or(self.z.values(), State::poses)
    }
}

impl Session {
    /// A session whose layers `activations` listens to, from the start on.
    pub(crate) fn listened(
        engine: Arc<Engine>,
        options: SessionOptions,
        activations: Option<Activations>,
    ) -> Result<Self> {
        options.check(&engine)?;
        let mut exec = engine.exec(options.threads)?;
        exec.listen(activations);
        Self::on(exec, engine, options)
    }

    /// What has been listening.
    pub(crate) fn stop_listening(&mut self) -> Option<Activations> {
        self.exec.listen(None)
    }

    /// Starts anew with `idle`, latents of an idle clip, as history.
    pub(crate) fn reset_to(&mut self, idle: Standardised<&[f32]>) {
        self.forget();
        let mut tools = Tools { exec: &mut self.exec, work: &mut self.work, engine: &self.engine };
        self.state.reset(&mut tools, &self.options, idle);
    }

    /// The last block.
    pub(crate) fn made(&self) -> MadeBlock {
        let BlockState { maker, frames, motion, .. } = &self.state;
        let (z, features, step) = match maker {
            Maker::Latent(maker) => (maker.z.clone(), maker.features.clone(), None),
            Maker::Step(maker) => (Standardised::default(), Standardised::default(), Some(maker.state.clone())),
        };
        MadeBlock { z, features, step, frames: frames.clone(), motion: motion.clone() }
    }

    /// Puts `block`, another session's of the same sizes, in the place of the one just made: its
    /// latent through this session's own decoder, or what its predictors remember; its motion as it
    /// stood.
    pub(crate) fn follow(&mut self, block: &MadeBlock) {
        let Self { exec, work, engine, state, .. } = self;
        let mut tools = Tools { exec, work, engine };
        if let (Some(maker), Kit::Sarah(mut tools)) = (state.maker.latent(), tools.kit()) {
            maker.generator.replace(maker.generator.next_token() - 1, block.z.view());
            tools.model.latent.restore(block.z.view(), maker.latent.view_mut());
            maker.decoder.back();
            tools.exec.begin();
            tools.decode(maker.decoding());
            maker.anchor.amend(maker.features.view());
            tools.exec.end();
        }
        if let (Some(maker), Some(step)) = (state.maker.step(), &block.step) {
            maker.state.clone_from(step);
        }
        state.motion.clone_from(&block.motion);
        // What is heard is heard at the head that was shown.
        state.frames.clone_from(&block.frames);
    }
}
