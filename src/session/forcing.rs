//! What a teacher does to a session: it listens to the layers, and puts another session's block in
//! the place of the one just made, so that the next one is made from that past. For the quantiser;
//! nothing of it is public.

use super::Session;
use super::options::SessionOptions;
use super::tools::Tools;
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
        MadeBlock {
            z: self.state.z.clone(),
            features: self.state.features.clone(),
            frames: self.state.frames.clone(),
            motion: self.state.motion.clone(),
        }
    }

    /// Puts `block`, another session's, in the place of the one just made: its latent through this
    /// session's own decoder, its motion as it stood.
    pub(crate) fn follow(&mut self, block: &MadeBlock) {
        let Self { exec, work, engine, state, .. } = self;
        state.generator.replace(state.generator.next_token() - 1, block.z.view());
        engine.latent.restore(block.z.view(), state.latent.view_mut());
        state.decoder.back();
        exec.begin();
        Tools { exec, work, engine }.decode(state.decoding());
        state.anchor.amend(state.features.view());
        state.motion.clone_from(&block.motion);
        self.exec.end();
    }
}
