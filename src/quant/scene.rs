//! A conversation cut into blocks.

use super::argument;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, Root};
use glam::Vec3;

/// A conversation cut into blocks.
#[derive(Debug, Clone)]
pub struct Scene {
    pub(super) agent: Vec<f32>,
    pub(super) user: Vec<f32>,
    /// The user's head at each frame.
    pub(super) heads: Vec<Option<Vec3>>,
    blocks: usize,
    pub(super) gaze: Option<f32>,
}

impl Scene {
    /// The whole blocks of `heads`, the user's head at each frame (world metres, `None` where unknown), with both voices
    /// (24 kHz mono; one that ends before is silent from there), and a gaze target or none.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) when there is not a whole block.
    pub fn new(agent: &[f32], user: &[f32], heads: &[Option<Vec3>], gaze: Option<f32>) -> Result<Self> {
        let blocks = heads.len() / BLOCK_FRAMES;
        if blocks == 0 {
            return Err(argument("the conversation is shorter than a block of four frames".to_owned()));
        }
        let voice = |v: &[f32]| {
            let mut v = v.to_vec();
            v.resize(blocks * BLOCK_SAMPLES, 0.0);
            v
        };
        Ok(Self {
            agent: voice(agent),
            user: voice(user),
            heads: heads[..blocks * BLOCK_FRAMES].to_vec(),
            blocks,
            gaze,
        })
    }

    /// The same user and length with the two voices exchanged: a conversation that nothing was chosen by.
    #[must_use]
    pub fn exchanged(&self) -> Self {
        Self { agent: self.user.clone(), user: self.agent.clone(), ..self.clone() }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    /// Of a voice, what `block` may know with a delay of `delay` blocks.
    pub(super) fn samples(voice: &[f32], block: usize, delay: u32) -> Option<&[f32]> {
        let heard = block.checked_sub(delay as usize)?;
        Some(&voice[heard * BLOCK_SAMPLES..][..BLOCK_SAMPLES])
    }

    /// The user over the block that `block` may know, in the agent's frame.
    pub(super) fn positions(&self, block: usize, delay: u32, root: &Root) -> Option<[f32; 2 * BLOCK_FRAMES]> {
        let seen = block.checked_sub(delay as usize)?;
        let mut positions = [0.0; 2 * BLOCK_FRAMES];
        for (i, xz) in positions.chunks_exact_mut(2).enumerate() {
            let local = root.to_local(self.heads[seen * BLOCK_FRAMES + i]?);
            xz.copy_from_slice(&[local.x, local.z]);
        }
        Some(positions)
    }
}
