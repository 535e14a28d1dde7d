//! All that one agent remembers.

use super::pose::pose_size;
use crate::frame::{BLOCK_FRAMES, Root};

/// What one agent's predictors remember, and the block that they are making. Allocates when made
/// and never after.
#[derive(Debug, Clone)]
pub struct State {
    pub(super) monadic: Vec<f32>,
    pub(super) dyadic: Vec<f32>,
    /// Steps so far: where rings of the memory stand.
    pub(super) frame: u64,
    /// Standardised poses of the last frame, and of the one before.
    pub(super) p: Vec<f32>,
    pub(super) q: Vec<f32>,
    /// The root after the last frame.
    pub(super) root: Root,
    /// The block's poses `[4, D]`, and whom its joints follow `[4, J]`.
    pub(super) y: Vec<f32>,
    pub(super) shares: Vec<f32>,
}

impl State {
    /// Zeros, for memories of these lengths.
    pub(super) fn new(monadic: usize, dyadic: usize, joints: usize) -> Self {
        let size = pose_size(joints);
        Self {
            monadic: vec![0.0; monadic],
            dyadic: vec![0.0; dyadic],
            frame: 0,
            p: vec![0.0; size],
            q: vec![0.0; size],
            root: Root::default(),
            y: vec![0.0; BLOCK_FRAMES * size],
            shares: vec![0.0; BLOCK_FRAMES * joints],
        }
    }

    /// Becomes `other`, of the same lengths, without allocating.
    pub(super) fn copy_from(&mut self, other: &Self) {
        let Self { monadic, dyadic, frame, p, q, root, y, shares } = self;
        for (to, from) in [
            (monadic, &other.monadic),
            (dyadic, &other.dyadic),
            (p, &other.p),
            (q, &other.q),
            (y, &other.y),
            (shares, &other.shares),
        ] {
            to.copy_from_slice(from);
        }
        (*frame, *root) = (other.frame, other.root);
    }

    /// Begins a block with the agent at `root`.
    pub fn begin(&mut self, root: Root) {
        self.root = root;
    }

    /// The block's poses, `[4, D]`.
    pub fn poses(&self) -> &[f32] {
        &self.y
    }

    /// How much each joint follows the user in the block's frames, `[4, J]`, 0 to 1.
    pub fn shares(&self) -> &[f32] {
        &self.shares
    }

    /// The standardised pose of the last frame, `[D]`.
    pub fn standardised(&self) -> &[f32] {
        &self.p
    }

    /// Whether all is numbers.
    pub fn is_finite(&self) -> bool {
        [&self.y, &self.p, &self.monadic, &self.dyadic].iter().all(|v| v.iter().all(|x| x.is_finite()))
    }

    /// Bytes of it.
    pub fn bytes(&self) -> usize {
        let floats = [&self.monadic, &self.dyadic, &self.p, &self.q, &self.y, &self.shares];
        size_of::<Self>() + 4 * floats.iter().map(|v| v.len()).sum::<usize>()
    }
}
