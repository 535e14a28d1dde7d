//! Re-anchoring: recent motion is encoded anew, so that the latents which the generator builds on
//! are what the encoder makes of the motion that was shown, however long the session has run.
//!
//! Nothing in the networks depends on where in the world the agent is (`ARCHITECTURE.md`), so the
//! world needs no anchor; what can wander off over minutes is the latent history. Every `period`
//! blocks, or when the agent has gone `radius` metres, the work is spread over the following
//! blocks, a bounded piece each:
//!
//! 1. *encode*: the encoder runs through the decoded frames of the last flow window, a few blocks
//!    at a time, until it has caught up with the present;
//! 2. *replace*: the new latents take the old ones' place in the history; slot caches are computed
//!    anew, a few passes of eight tokens per block (what is still to come keeps the old latents'
//!    keys, which describe the same motion);
//! 3. *decode*: a second decoder state runs through the new latents until it has caught up; then
//!    both decode the same latent once, and the four frames are cross-faded from the one to the
//!    other.
//!
//! A block that has no time for its share gives the round up; a new one starts when there is time.

use super::diagnostics::Anchoring;
use super::governor::Share;
use super::options::SessionOptions;
use super::tools::SarahTools;
use crate::config::Config;
use crate::engine::Sarah;
use crate::flow::{Generator, Stretch};
use crate::frame::{BLOCK_FRAMES, Root};
use crate::normaliser::{Metric, Standardised};
use crate::vae::{DecoderState, Decoding, EncoderState};

/// Blocks that are encoded, or decoded, in one block's time.
const BLOCKS_PER_STEP: u64 = 3;
/// Passes over a slot cache in one block's time.
const PASSES_PER_STEP: usize = 2;

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
    /// Decoded features of the last blocks, and their new latents.
    features: Standardised,
    latents: Metric,
    width: usize,
    latent: usize,
    scratch: Standardised,
    z: Standardised,
    restored: Metric,
    count: u64,
}

/// The block that was just made, and what re-anchoring may change.
pub(super) struct Moment<'a> {
    pub(super) generator: &'a mut Generator,
    /// What `features` come from; another decoder may take over.
    pub(super) decoder: &'a mut DecoderState,
    pub(super) latent: Metric<&'a [f32]>,
    /// What was decoded, which may be cross-faded; `None` where the latent was not usable: what is
    /// shown instead comes with [`Anchor::amend`].
    pub(super) features: Option<Standardised<&'a mut [f32]>>,
    pub(super) root: Root,
    /// Whether there is time for a share of the work.
    pub(super) time: bool,
}

impl Moment<'_> {
    fn features(&self) -> Option<Standardised<&[f32]>> {
        self.features.as_ref().map(Standardised::view)
    }
}

impl Anchor {
    pub(super) fn new(config: &Config, sarah: &Sarah, options: &SessionOptions) -> Self {
        let period = match options.diagnostics.anchoring {
            _ if sarah.encoder.is_none() => 0,
            Anchoring::Bundle => config.session.anchor_period,
            Anchoring::Never => 0,
            Anchoring::Every(blocks) => blocks,
        };
        // Without re-anchoring nobody looks back.
        let capacity = if period == 0 { 1 } else { config.flow.window_blocks as u64 + 1 };
        let (width, latent) = (BLOCK_FRAMES * sarah.features(), config.vae.latent);
        Self {
            period: u64::from(period),
            radius: f64::from(config.session.anchor_radius),
            phase: Phase::Rest,
            blocks: 0,
            first: 0,
            started: 0,
            anchored_at: 0,
            requested: false,
            anchor: options.start,
            encoder: sarah.encoder.as_ref().map(|encoder| encoder.state(options.diagnostics.cache)),
            next: sarah.decoder.state(options.diagnostics.cache),
            capacity,
            features: Standardised::zeros(capacity as usize * width),
            latents: Metric::zeros(capacity as usize * latent),
            width,
            latent,
            scratch: Standardised::zeros(width),
            z: Standardised::zeros(latent),
            restored: Metric::zeros(latent),
            count: 0,
        }
    }

    /// Forgets everything; the next block gets the number `first`.
    pub(super) fn reset(&mut self, start: Root, first: u64) {
        (self.phase, self.requested) = (Phase::Rest, false);
        (self.first, self.blocks, self.started, self.anchored_at) = (first, first, first, first);
        (self.anchor, self.count) = (start, 0);
    }

    /// Starts a round as soon as there is time, because what the history holds is not what was
    /// shown.
    pub(super) fn request(&mut self) {
        (self.phase, self.requested) = (Phase::Rest, true);
    }

    /// Replaces the features of the block that was remembered last.
    pub(super) fn amend(&mut self, features: Standardised<&[f32]>) {
        if let Some(last) = self.blocks.checked_sub(1) {
            self.keep(last, features);
        }
    }

    /// What the next block will do, at most.
    pub(super) fn share(&self) -> Share {
        match self.phase {
            Phase::Rest => Share::default(),
            Phase::Encode(_) => Share { encoded: BLOCKS_PER_STEP, ..Share::default() },
            Phase::Refill(..) => Share { passes: PASSES_PER_STEP as u64, ..Share::default() },
            Phase::Decode(_) => Share { decoded: BLOCKS_PER_STEP + 1, ..Share::default() },
        }
    }

    /// Times that the session has re-anchored.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    pub(super) fn cache_bytes(&self) -> usize {
        self.encoder.as_ref().map_or(0, EncoderState::cache_bytes) + self.next.cache_bytes()
    }

    /// Remembers the decoded features of a block; without any those are due that [`Anchor::amend`]
    /// brings.
    pub(super) fn remember(&mut self, features: Option<Standardised<&[f32]>>) {
        if let Some(features) = features {
            self.keep(self.blocks, features);
        }
        self.blocks += 1;
    }

    fn keep(&mut self, block: u64, features: Standardised<&[f32]>) {
        let at = self.at(block);
        self.features.part_mut(at..at + 1, self.width).values_mut().copy_from_slice(features.values());
    }

    /// Does a block's share of the work; may cross-fade the features and swap decoders.
    pub(super) fn step(&mut self, tools: &mut SarahTools<'_>, mut moment: Moment<'_>) {
        if self.period == 0 {
            return;
        }
        if !moment.time {
            self.phase = Phase::Rest;
            return self.remember(moment.features());
        }
        match self.phase {
            Phase::Rest => self.consider(&moment.root),
            Phase::Encode(from) => self.encode(tools, &mut moment, from),
            Phase::Refill(slot, from) => self.refill(tools, &mut moment, slot, from),
            Phase::Decode(from) => self.decode(tools, &mut moment, from),
        }
        self.remember(moment.features());
    }

    /// Encodes a few blocks from `from` on; when the present is reached, new latents replace the
    /// old ones.
    fn encode(&mut self, tools: &mut SarahTools<'_>, moment: &mut Moment<'_>, from: u64) {
        let (model, current) = (tools.model, self.blocks);
        let to = current.min(from + BLOCKS_PER_STEP);
        for block in from..to {
            let at = self.at(block);
            let features = self.features.part(at..at + 1, self.width);
            let latent = self.latents.part_mut(at..at + 1, self.latent);
            if let Some((encoder, state)) = model.encoder.as_ref().zip(self.encoder.as_mut()) {
                encoder.step(tools.exec, tools.vae, state, features, latent);
            }
        }
        self.phase = Phase::Encode(to);
        if to == current {
            self.started = self.started.max(current.saturating_sub(self.capacity - 1));
            for block in self.started..current {
                let at = self.at(block);
                model.latent.standardise(self.latents.part(at..at + 1, self.latent), self.z.view_mut());
                moment.generator.replace(block, self.z.view());
            }
            self.phase = Phase::Refill(0, self.started);
        }
    }

    /// Computes a few passes of slot caches anew, from slot `slot` and token `from` on.
    fn refill(&mut self, tools: &mut SarahTools<'_>, moment: &mut Moment<'_>, mut slot: usize, mut from: u64) {
        let generator = &mut *moment.generator;
        for _ in 0..PASSES_PER_STEP {
            if slot >= generator.slot_count() {
                break;
            }
            match generator.rewrite(&mut tools.flow(), slot, Stretch { oldest: self.started, from }) {
                Some(next) => from = next,
                None => (slot, from) = (slot + 1, self.started),
            }
        }
        self.phase = Phase::Refill(slot, from);
        if slot >= generator.slot_count() {
            // As much past as the decoder sees, and no more than the history is sure to hold.
            let config = tools.config;
            let window = config.vae.window_blocks.min(config.flow.window_blocks) as u64;
            let from = self.blocks.saturating_sub(window).max(self.first);
            self.next.reset(from);
            self.phase = Phase::Decode(from);
        }
    }

    /// Decodes a few blocks from `from` on; when the present is reached, the decoder takes over.
    fn decode(&mut self, tools: &mut SarahTools<'_>, moment: &mut Moment<'_>, from: u64) {
        let current = self.blocks;
        let to = current.min(from + BLOCKS_PER_STEP);
        let Self { next, scratch, restored, .. } = self;
        for block in from..to {
            tools.model.latent.restore(moment.generator.latent(block), restored.view_mut());
            tools.decode(Decoding { state: next, z: restored.view(), out: scratch.view_mut() });
        }
        self.phase = Phase::Decode(to);
        if to == current {
            tools.decode(Decoding { state: next, z: moment.latent, out: scratch.view_mut() });
            if let Some(features) = &mut moment.features {
                cross_fade(features.values_mut(), scratch.values());
            }
            std::mem::swap(moment.decoder, next);
            (self.phase, self.count) = (Phase::Rest, self.count + 1);
            (self.anchor, self.anchored_at) = (moment.root, current);
        }
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

    /// Where a block is remembered.
    fn at(&self, block: u64) -> usize {
        (block % self.capacity) as usize
    }
}

/// `from` becomes `from` at its start and `to` at its end, in equal steps per frame; features are
/// linear in the joints.
fn cross_fade(from: &mut [f32], to: &[f32]) {
    let width = from.len() / BLOCK_FRAMES;
    for (i, (from, to)) in from.chunks_exact_mut(width).zip(to.chunks_exact(width)).enumerate() {
        let weight = (i + 1) as f32 / (BLOCK_FRAMES + 1) as f32;
        from.iter_mut().zip(to).for_each(|(from, to)| *from += weight * (to - *from));
    }
}
