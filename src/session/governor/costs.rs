//! What a block costs, in units of work: millions of multiply-adds, as the config's sizes give
//! them.
//!
//! A pass over `r` rows counts as `r + 1` rows: reading the weights takes time as well. The shares
//! were checked against block times of the shipped model: midpoint4, midpoint2 and the single step
//! stand as 3.5 to 2.2 to 1, measured 2.7 to 1.8 to 1. The governor's headroom covers the
//! difference.

use crate::config::Config;
use crate::flow::Generator;
use crate::frame::{BLOCK_SAMPLES, Sampler};

/// Tokens that a pass over a slot commits at most.
const CHUNK: u64 = 8;

/// What a block does for re-anchoring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(in crate::session) struct Share {
    /// Blocks that are encoded.
    pub(in crate::session) encoded: u64,
    /// Passes of eight tokens over a slot.
    pub(in crate::session) passes: u64,
    /// Blocks that are decoded.
    pub(in crate::session) decoded: u64,
}

/// Prices of the parts of a block.
#[derive(Debug, Clone, Copy)]
pub(in crate::session) struct Work {
    /// Both voices, the decoder.
    base: f64,
    /// A row of a pass over the flow network.
    row: f64,
    encoded: f64,
    decoded: f64,
}

impl Work {
    pub(in crate::session) fn new(c: &Config) -> Self {
        let transformer =
            |layers: usize, width: usize, mlp: usize| layers as f64 * (width * width * (4 + 2 * mlp)) as f64;
        let stack = transformer(c.vae.layers, c.vae.width, c.vae.mlp) / 1e6;
        let mut rows = BLOCK_SAMPLES as f64;
        let audio: f64 = (c.audio.layers.iter())
            .map(|l| {
                rows /= l.stride as f64;
                rows * (l.kernel * l.inputs * l.outputs) as f64 / 1e6
            })
            .sum();
        let (encoded, decoded) = (7.0 * stack, 6.0 * stack);
        Self {
            base: 2.0 * audio + decoded,
            row: transformer(c.flow.layers, c.flow.width, c.flow.mlp) / 1e6,
            encoded,
            decoded,
        }
    }

    /// A pass of a full chunk with `branches` branches.
    pub(in crate::session) fn pass(&self, branches: usize) -> f64 {
        self.row * (1.0 + (CHUNK * branches as u64) as f64)
    }

    /// A block's share of re-anchoring.
    pub(in crate::session) fn anchor(&self, share: Share, branches: usize) -> f64 {
        share.encoded as f64 * self.encoded
            + share.decoded as f64 * self.decoded
            + share.passes as f64 * self.pass(branches)
    }

    /// A block with `sampler`: with its slots up to date, and as far behind as they are.
    pub(in crate::session) fn block(&self, generator: &Generator, sampler: Sampler, branches: usize) -> [f64; 2] {
        let evaluation = |branches: usize, behind: u64| {
            // What does not fit into the pass of the evaluation goes before it, eight tokens a
            // pass.
            let before = behind.saturating_sub(1) / CHUNK;
            self.row * ((behind + 1) as f64 * branches as f64 + before as f64 + 1.0)
        };
        let mut costs = [self.base; 2];
        for slot in generator.visits(sampler) {
            let branches = if generator.guides(slot) { branches } else { 1 };
            costs[0] += evaluation(branches, 1);
            costs[1] += evaluation(branches, generator.behind(slot));
        }
        costs
    }

    /// A rehearsal of `sampler`.
    pub(in crate::session) fn rehearsal(&self, sampler: Sampler, branches: usize) -> f64 {
        self.row * (1.0 + 2.0 * if sampler == Sampler::Single { 1.0 } else { branches as f64 })
    }
}
