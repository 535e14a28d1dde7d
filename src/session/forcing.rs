//! What a teacher does to a session: it listens to the layers, and puts another session's block in
//! the place of the one just made, so that the next one is made from that past. For the quantiser,
//! and of the flow model alone; nothing of it is public.

use super::Session;
use super::maker::Maker;
use super::options::SessionOptions;
use super::state::BlockState;
use super::tools::{Kit, Tools};
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
    /// The latent.
    pub(crate) z: Standardised,
    /// The features as decoded, `[4, features]`.
    pub(crate) features: Standardised,
    /// The frames.
    pub(crate) frames: Vec<Frame>,
    motion: pose::Decoder,
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
        let (z, features) = match maker {
            Maker::Latent(maker) => (maker.z.clone(), maker.features.clone()),
            Maker::Step(_) => Default::default(),
        };
        MadeBlock { z, features, frames: frames.clone(), motion: motion.clone() }
    }

    /// Puts `block`, another session's, in the place of the one just made: its latent through this
    /// session's own decoder, its motion as it stood.
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
        state.motion.clone_from(&block.motion);
        // What is heard is heard at the head that was shown.
        state.frames.clone_from(&block.frames);
    }
}
