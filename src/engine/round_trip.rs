//! Motion through encoder and decoder.

use super::Engine;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, Frame};
use crate::kernels::KvDtype;
use crate::pose;

impl Engine {
    /// The whole blocks of `frames` through encoder and decoder, as decoded: borders are not bridged and feet not held.
    ///
    /// # Errors
    /// [`State`](crate::ErrorKind::State) without the encoder; those of decoding values that are not finite.
    #[doc(hidden)]
    pub fn round_trip(&self, frames: &[Frame]) -> Result<Vec<Frame>> {
        let rig = &self.config.rig;
        let radius = self.config.pose.radius;
        let width = self.features();
        let network = self.encoder()?;
        let mut exec = self.exec(1)?;
        let (mut encoder, mut decoder) = (network.state(KvDtype::F32), self.decoder.state(KvDtype::F32));
        let (mut features, mut motion) = (pose::Encoder::new(radius), pose::Decoder::new(self.kernels, rig, radius));
        motion.reset(frames.first().map(|f| f.root).unwrap_or_default());
        let (mut x, mut raw) = (vec![0.0; BLOCK_FRAMES * width], vec![0.0; BLOCK_FRAMES * width]);
        let mut latent = vec![0.0; self.config.vae.latent];
        let mut out = Vec::with_capacity(frames.len());
        let mut block = vec![Frame::empty(rig.len()); BLOCK_FRAMES];
        exec.begin();
        for four in frames.chunks_exact(BLOCK_FRAMES) {
            for (frame, x) in four.iter().zip(raw.chunks_exact_mut(width)) {
                features.encode(frame.root, &frame.global, x);
            }
            self.pose.standardise(&raw, &mut x);
            network.step(&mut exec, &mut encoder, &x, &mut latent);
            self.decoder.step(&mut exec, &mut decoder, &latent, &mut x);
            self.pose.restore(&mut x);
            motion.decode_block(&x, &mut block)?;
            out.extend(block.iter().cloned());
        }
        exec.end();
        Ok(out)
    }
}
