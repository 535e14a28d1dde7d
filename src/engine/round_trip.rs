//! Motion through encoder and decoder.

use super::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, Frame};
use crate::kernels::KvDtype;
use crate::normaliser::{Metric, Standardised};
use crate::pose;
use crate::vae::{Encoder, RoundTrip};

impl Engine {
    /// The encoder of motion, for whoever cannot do without.
    ///
    /// # Errors
    /// [`ErrorKind::State`] when it was not loaded, [`ErrorKind::Argument`] for a bundle without one.
    pub(crate) fn encoder(&self) -> Result<&Encoder> {
        let missing = || Error::new(ErrorKind::State, "this engine was loaded without the encoder; load all networks");
        self.sarah()?.encoder.as_ref().ok_or_else(missing)
    }

    /// The whole blocks of `frames` through encoder and decoder, as decoded: borders are not
    /// bridged and feet not held.
    ///
    /// # Errors
    /// [`Argument`](crate::ErrorKind::Argument) for a bundle without one,
    /// [`State`](crate::ErrorKind::State) where it was not loaded; those of decoding values that are
    /// not finite.
    #[doc(hidden)]
    pub fn round_trip(&self, frames: &[Frame]) -> Result<Vec<Frame>> {
        self.through(frames, pose::Decoder::new(self.kernels, &self.config.rig, self.config.pose.radius))
    }

    /// As [`Engine::round_trip`], shown as a session shows what it decodes: guarded, borders
    /// bridged, feet held.
    ///
    /// # Errors
    /// As [`Engine::round_trip`].
    #[doc(hidden)]
    pub fn round_trip_shown(&self, frames: &[Frame]) -> Result<Vec<Frame>> {
        let rig = &self.config.rig;
        let mut motion = pose::Decoder::new(self.kernels, rig, self.config.pose.radius).with_guard().with_stance(rig);
        if self.config.session.bridge > 0.0 {
            motion = motion.with_bridge(rig, self.config.session.bridge);
        }
        self.through(frames, motion)
    }

    fn through(&self, frames: &[Frame], mut motion: pose::Decoder) -> Result<Vec<Frame>> {
        let rig = &self.config.rig;
        let sarah = self.sarah()?;
        let width = sarah.features();
        let mut exec = self.exec(1)?;
        let mut networks = RoundTrip::new(self.encoder()?, &sarah.decoder, sarah.latent.width(), KvDtype::F32);
        let mut features = pose::Encoder::new(self.config.pose.radius);
        motion.reset(frames.first().map(|f| f.root).unwrap_or_default());
        let mut metric = Metric::zeros(BLOCK_FRAMES * width);
        let [mut x, mut y] = [(); 2].map(|()| Standardised::zeros(BLOCK_FRAMES * width));
        let mut out = Vec::with_capacity(frames.len());
        let mut block = vec![Frame::empty(rig.len()); BLOCK_FRAMES];
        exec.begin();
        for four in frames.chunks_exact(BLOCK_FRAMES) {
            for (i, frame) in four.iter().enumerate() {
                features.encode(frame.root, &frame.global, metric.part_mut(i..i + 1, width));
            }
            sarah.pose.standardise(metric.view(), x.view_mut());
            networks.step(&mut exec, x.view(), y.view_mut());
            sarah.pose.restore(y.view(), metric.view_mut());
            motion.decode_block(metric.view(), &mut block)?;
            out.extend(block.iter().cloned());
        }
        exec.end();
        Ok(out)
    }
}
