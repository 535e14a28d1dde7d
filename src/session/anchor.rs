//! Re-anchoring: recent motion is encoded anew, so that the latents which the generator builds on are what the encoder
//! makes of the motion that was shown, however long the session has run.
//!
//! Nothing in the networks depends on where in the world the agent is (`ARCHITECTURE.md`), so the world needs no anchor;
//! what can wander off over minutes is the latent history. Every `period` blocks, or when the agent has gone
//! `radius` metres, the work is spread over the following blocks, a bounded piece each:
//!
//! 1. *encode*: the encoder runs through the decoded frames of the last flow window, a few blocks at a time, until it has
//!    caught up with the present;
//! 2. *replace*: the new latents take the old ones' place in the history; slot caches are computed anew, a few passes of
//!    eight tokens a block (what is still to come keeps the old latents' keys, which describe the same motion);
//! 3. *decode*: a second decoder state runs through the new latents until it has caught up; then both decode the same
//!    latent once, and the four frames are cross-faded from the one to the other.
//!
//! A block that has no time for its share gives the round up; a new one starts when there is time.

use super::diagnostics::Anchoring;
use super::governor::Share;
use super::options::SessionOptions;
use crate::engine::Engine;
use crate::flow::Generator;
use crate::frame::{BLOCK_FRAMES, Root};
use crate::kernels::Exec;
use crate::vae::{DecoderState, EncoderState};

/// Blocks that are encoded, or decoded, in one block's time.
const BLOCKS_A_STEP: u64 = 3;
/// Passes over a slot cache in one block's time.
const PASSES_A_STEP: usize = 2;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Rest,
    /// The next block to encode.
    Encode(u64),
    /// The next slot to refill, and the token to go on with.
    Refill(usize, u64),
    /// The next block to decode.
    Decode(u64),
}

#[derive(Debug)]
pub(super) struct Anchor {
    period: u64,
    radius: f64,
    phase: Phase,
    /// Blocks remembered so far; block numbers here count the idle clip's blocks too, as tokens do.
    blocks: u64,
    /// Number of the first block.
    first: u64,
    started: u64,
    anchored_at: u64,
    /// Asked for before it is due.
    requested: bool,
    anchor: Root,
    encoder: Option<EncoderState>,
    /// The decoder that takes over.
    next: DecoderState,
    capacity: u64,
    /// Decoded features of the last blocks, standardised, and their new latents, unstandardised.
    features: Vec<f32>,
    latents: Vec<f32>,
    width: usize,
    latent: usize,
    scratch: Vec<f32>,
    z: Vec<f32>,
    count: u64,
}

impl Anchor {
    pub(super) fn new(engine: &Engine, options: &SessionOptions) -> Self {
        let period = match options.diagnostics.anchoring {
            _ if engine.encoder.is_none() => 0,
            Anchoring::Bundle => engine.config.session.anchor_period,
            Anchoring::Never => 0,
            Anchoring::Every(blocks) => blocks,
        };
        // Without re-anchoring nobody looks back.
        let capacity = if period == 0 { 1 } else { engine.config.flow.window_blocks as u64 + 1 };
        let (width, latent) = (BLOCK_FRAMES * engine.features(), engine.config.vae.latent);
        Self {
            period: u64::from(period),
            radius: f64::from(engine.config.session.anchor_radius),
            phase: Phase::Rest,
            blocks: 0,
            first: 0,
            started: 0,
            anchored_at: 0,
            requested: false,
            anchor: options.start,
            encoder: engine.encoder.as_ref().map(|encoder| encoder.state(options.diagnostics.cache)),
            next: engine.decoder.state(options.diagnostics.cache),
            capacity,
            features: vec![0.0; capacity as usize * width],
            latents: vec![0.0; capacity as usize * latent],
            width,
            latent,
            scratch: vec![0.0; width],
            z: vec![0.0; latent],
            count: 0,
        }
    }

    /// Forgets everything; the next block gets the number `first`.
    pub(super) fn reset(&mut self, start: Root, first: u64) {
        (self.phase, self.requested) = (Phase::Rest, false);
        (self.first, self.blocks, self.started, self.anchored_at) = (first, first, first, first);
        (self.anchor, self.count) = (start, 0);
    }

    /// Starts a round as soon as there is time, because what the history holds is not what was shown.
    pub(super) fn request(&mut self) {
        (self.phase, self.requested) = (Phase::Rest, true);
    }

    /// Replaces the features (standardised) of the block that was remembered last.
    pub(super) fn amend(&mut self, features: &[f32]) {
        if let Some(last) = self.blocks.checked_sub(1) {
            let at = self.slot(last) * self.width;
            self.features[at..][..self.width].copy_from_slice(features);
        }
    }

    /// What the next block will do, at most.
    pub(super) fn share(&self) -> Share {
        match self.phase {
            Phase::Rest => Share::default(),
            Phase::Encode(_) => Share { encoded: BLOCKS_A_STEP, ..Share::default() },
            Phase::Refill(..) => Share { passes: PASSES_A_STEP as u64, ..Share::default() },
            Phase::Decode(_) => Share { decoded: BLOCKS_A_STEP + 1, ..Share::default() },
        }
    }

    /// Times that the session has re-anchored.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn cache_bytes(&self) -> usize {
        self.encoder.as_ref().map_or(0, EncoderState::cache_bytes) + self.next.cache_bytes()
    }

    /// Remembers the decoded features (standardised) of a block.
    pub(super) fn remember(&mut self, features: &[f32]) {
        let at = self.slot(self.blocks) * self.width;
        self.features[at..][..self.width].copy_from_slice(features);
        self.blocks += 1;
    }

    /// Does a block's share of the work; may cross-fade `features`, which `decoder` made of `latent`, and swap decoders.
    #[allow(clippy::too_many_arguments, reason = "it reaches back from the end of the data flow to its middle")]
    pub(super) fn step(
        &mut self,
        exec: &mut Exec,
        engine: &Engine,
        generator: &mut Generator,
        decoder: &mut DecoderState,
        latent: &[f32],
        features: &mut [f32],
        root: &Root,
        time: bool,
    ) {
        if self.period == 0 {
            return;
        }
        if !time {
            self.phase = Phase::Rest;
            return self.remember(features);
        }
        // The block that was just made: `latent` is its token's, `features` are its frames.
        let current = self.blocks;
        match self.phase {
            Phase::Rest => self.consider(root),
            Phase::Encode(from) => {
                let to = current.min(from + BLOCKS_A_STEP);
                (from..to).for_each(|block| self.encode(exec, engine, block));
                self.phase = Phase::Encode(to);
                if to == current {
                    self.started = self.started.max(current.saturating_sub(self.capacity - 1));
                    for block in self.started..current {
                        let at = self.slot(block) * self.latent;
                        self.z.copy_from_slice(&self.latents[at..][..self.latent]);
                        engine.latent.standardise_in_place(&mut self.z);
                        generator.history_mut().replace(block, &self.z);
                    }
                    self.phase = Phase::Refill(0, self.started);
                }
            }
            Phase::Refill(mut slot, mut from) => {
                for _ in 0..PASSES_A_STEP {
                    if slot >= generator.slot_count() {
                        break;
                    }
                    match generator.rewrite(exec, engine.nets(), slot, self.started, from) {
                        Some(next) => from = next,
                        None => (slot, from) = (slot + 1, self.started),
                    }
                }
                self.phase = Phase::Refill(slot, from);
                if slot >= generator.slot_count() {
                    // As much past as the decoder sees, and no more than the history is sure to hold.
                    let window = engine.config.vae.window_blocks.min(engine.config.flow.window_blocks) as u64;
                    let from = current.saturating_sub(window).max(self.first);
                    self.next.reset(from);
                    self.phase = Phase::Decode(from);
                }
            }
            Phase::Decode(from) => {
                let to = current.min(from + BLOCKS_A_STEP);
                for block in from..to {
                    self.z.copy_from_slice(generator.history().z(block));
                    engine.latent.restore(&mut self.z);
                    engine.decoder.step(exec, &mut self.next, &self.z, &mut self.scratch);
                }
                self.phase = Phase::Decode(to);
                if to == current {
                    engine.decoder.step(exec, &mut self.next, latent, &mut self.scratch);
                    cross_fade(features, &self.scratch);
                    std::mem::swap(decoder, &mut self.next);
                    (self.phase, self.count) = (Phase::Rest, self.count + 1);
                    (self.anchor, self.anchored_at) = (*root, current);
                }
            }
        }
        self.remember(features);
    }

    fn consider(&mut self, root: &Root) {
        let far = libm::hypot(root.x - self.anchor.x, root.z - self.anchor.z) > self.radius;
        if far || self.requested || self.blocks >= self.anchored_at + self.period {
            self.requested = false;
            self.started = self.blocks.saturating_sub(self.capacity - 1).max(self.first);
            self.encoder.iter_mut().for_each(|encoder| encoder.reset(self.started));
            self.phase = Phase::Encode(self.started);
        }
    }

    fn encode(&mut self, exec: &mut Exec, engine: &Engine, block: u64) {
        let slot = self.slot(block);
        let features = &self.features[slot * self.width..][..self.width];
        let latent = &mut self.latents[slot * self.latent..][..self.latent];
        if let Some((encoder, state)) = engine.encoder.as_ref().zip(self.encoder.as_mut()) {
            encoder.step(exec, state, features, latent);
        }
    }

    fn slot(&self, block: u64) -> usize {
        (block % self.capacity) as usize
    }
}

/// `from` becomes `from` at its start and `to` at its end, in equal steps a frame; features are linear in the joints.
fn cross_fade(from: &mut [f32], to: &[f32]) {
    let width = from.len() / BLOCK_FRAMES;
    for (i, (from, to)) in from.chunks_exact_mut(width).zip(to.chunks_exact(width)).enumerate() {
        let weight = (i + 1) as f32 / (BLOCK_FRAMES + 1) as f32;
        from.iter_mut().zip(to).for_each(|(from, to)| *from += weight * (to - *from));
    }
}
