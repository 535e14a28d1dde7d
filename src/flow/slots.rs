//! One key-value cache per flow time: what a network remembers of the history.
//!
//! Rings are numbered by slot, branch and layer; those of the gaze branch come after all others, and
//! are not touched, hence take no memory, before there is a gaze target: until then the branch is
//! the one without. Position `t` of a ring holds token `t`. A pass writes
//! the new token's keys and values too; they are provisional, and the next pass over that position,
//! when the token is finished, overwrites them.

use super::history::History;
use super::modulation::Modulation;
use super::network::FlowNet;
use super::projected::{INPUTS, Projected};
use super::schedule::{Branches, SlotTimes, flow_times};
use crate::error::Result;
use crate::kernels::{Exec, KvCache, KvDtype};
use crate::nn::Rows;
use std::ops::Range;
use std::sync::Arc;

/// Finished tokens that one pass commits at most.
pub(super) const CHUNK: u64 = 8;

/// Rows of a pass at most: those of a full chunk and a new token in each of three branches.
pub(super) const ROWS: usize = 3 * (CHUNK as usize + 1);

/// Predictions that [`Slots::x1`] holds: one for each branch of [`Branches::Guided`].
const PREDICTIONS: usize = 3;

/// Branch numbers of [`Branches::Guided`].
pub(super) const UNCONDITIONAL: usize = 0;
pub(super) const NO_GAZE: usize = 1;
pub(super) const GAZE: usize = 2;

/// A slot: the flow time at which its history is seen, its branches, and how far its cache is
/// filled.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot {
    tau_history: f32,
    branches: Branches,
    /// Rings of its branches but the gaze branch begin here, those of the gaze branch there.
    rings: [usize; 2],
    /// Tokens before this are in the cache.
    pub(super) committed: u64,
    /// Tokens from this on are in the cache without a gap.
    pub(super) start: u64,
}

/// The slots of one network.
#[derive(Debug)]
pub struct Slots {
    pub(super) slots: Vec<Slot>,
    modulation: Arc<Modulation>,
    cache: KvCache,
    /// Whether the gaze branch has rings of its own.
    gaze: bool,
    layers: usize,
    pub(super) window: u64,
    projected: Projected,
    /// The rows of the pass under way.
    rows: Rows,
    /// Prediction of the last evaluation, `[3, latent]`.
    x1: Vec<f32>,
}

impl Slots {
    /// Slots for flow times.
    ///
    /// # Errors
    /// As [`FlowNet::modulation`].
    pub fn new(exec: &mut Exec, net: &FlowNet, times: &[SlotTimes], dtype: KvDtype) -> Result<Self> {
        let c = net.config();
        let window = c.window_blocks as u64;
        let capacity = window + CHUNK;
        let guided = times.iter().filter(|times| times.branches == Branches::Guided).count();
        let mut rings = [0, (times.len() + guided) * c.layers];
        let slots: Vec<_> = (times.iter())
            .map(|times| {
                let slot = Slot { tau_history: times.history, branches: times.branches, rings, committed: 0, start: 0 };
                let own = if times.branches == Branches::Guided { [2, 1] } else { [1, 0] };
                rings = [rings[0] + own[0] * c.layers, rings[1] + own[1] * c.layers];
                slot
            })
            .collect();
        Ok(Self {
            modulation: net.modulation(exec, &flow_times(times))?,
            cache: KvCache::new(rings[1], capacity as usize, c.heads, c.width, dtype),
            slots,
            gaze: false,
            layers: c.layers,
            window,
            projected: Projected::new(capacity + 1, c.width),
            rows: Rows::with_capacity(ROWS),
            x1: vec![0.0; PREDICTIONS * net.latent()],
        })
    }

    /// Forgets all tokens; the next one has the index `next`.
    pub fn reset(&mut self, next: u64) {
        self.projected.forget(next);
        self.slots.iter_mut().for_each(|s| (s.committed, s.start) = (next, next));
    }

    /// Whether rows of the same slots of `self` and `other` can go through the layers together:
    /// modulation is the same.
    pub(super) fn alike(&self, other: &Slots) -> bool {
        let same =
            |(a, b): (&Slot, &Slot)| a.tau_history.to_bits() == b.tau_history.to_bits() && a.branches == b.branches;
        self.slots.len() == other.slots.len() && self.slots.iter().zip(&other.slots).all(same)
    }

    /// Bytes of the caches that are in use.
    pub fn cache_bytes(&self) -> usize {
        let guided = self.guided();
        let all = self.slots.len() + 2 * guided;
        self.cache.bytes() / all * if self.gaze { all } else { all - guided }
    }

    /// Number of slots that are guided.
    fn guided(&self) -> usize {
        self.slots.iter().filter(|slot| slot.branches == Branches::Guided).count()
    }

    /// Number of slots.
    pub fn count(&self) -> usize {
        self.slots.len()
    }

    /// Finished tokens that slot `slot` lacks, a window at most, when `end` tokens are finished.
    pub fn behind(&self, slot: usize, end: u64) -> u64 {
        (end - self.slots[slot].committed.min(end)).min(self.window)
    }

    /// Branches of slot `slot`.
    pub fn branches(&self, slot: usize) -> Branches {
        self.slots[slot].branches
    }

    /// Prediction of the last evaluation, `[3, latent]`: of each branch of a guided slot. Where gaze
    /// is not guided, the gaze branch equals the one without; in a plain slot all are one.
    pub fn x1(&self) -> &[f32] {
        &self.x1
    }

    /// Forgets the new token's conditioning, which will be another one when the token is made.
    pub(super) fn forget_new(&mut self, history: &History) {
        self.projected.forget_from(history.len());
    }

    fn ring(&self, slot: usize, branch: usize) -> usize {
        let [first, gaze] = self.slots[slot].rings;
        if branch == GAZE { gaze } else { first + branch * self.layers }
    }

    /// Gives the gaze branches rings of their own, with what the branches without a target hold.
    pub(super) fn open_gaze(&mut self) {
        if std::mem::replace(&mut self.gaze, true) {
            return;
        }
        for slot in (0..self.slots.len()).filter(|slot| self.slots[*slot].branches == Branches::Guided) {
            let (from, to) = (self.ring(slot, NO_GAZE), self.ring(slot, GAZE));
            (0..self.layers).for_each(|layer| self.cache.copy_ring(from + layer, to + layer));
        }
    }
}

/// What passes do with slots.
impl Slots {
    pub(super) fn modulation(&self) -> &Arc<Modulation> {
        &self.modulation
    }

    pub(super) fn tau_history(&self, slot: usize) -> f32 {
        self.slots[slot].tau_history
    }

    /// Projects the conditioning of `token` unless it has been.
    pub(super) fn project(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        token: u64,
        embedded: &mut [f32],
    ) {
        if let Some(projected) = self.projected.missing(token) {
            net.project(exec, history.condition(token), embedded, projected);
        }
    }

    /// The projected conditioning of `token`.
    pub(super) fn projected(&self, token: u64) -> [&[f32]; INPUTS] {
        self.projected.of(token)
    }

    /// Branches of slot `slot` that are run for `token`: the gaze branch only where a target is
    /// guided towards.
    pub(super) fn active(&self, slot: usize, history: &History, token: u64) -> Range<usize> {
        match self.branches(slot) {
            Branches::Plain => 0..1,
            Branches::Guided if history.condition(token).guides_gaze() => 0..3,
            Branches::Guided => 0..2,
        }
    }

    /// Begins the rows of a pass; `guided` tells whether any of them has a gaze target to be guided
    /// towards.
    pub(super) fn begin_rows(&mut self, guided: bool) {
        self.rows.clear();
        if guided {
            self.open_gaze();
        }
    }

    /// Adds the row of `token` in a branch of slot `slot`.
    pub(super) fn push_row(&mut self, slot: usize, branch: usize, token: u64) {
        let first = (token + 1).saturating_sub(self.window).max(self.slots[slot].start);
        self.rows.push(self.ring(slot, branch), token, first);
    }

    /// Number of rows of the pass under way.
    pub(super) fn rows(&self) -> usize {
        self.rows.len()
    }

    /// The attention of its rows in layer `layer`.
    pub(super) fn attend(&mut self, exec: &mut Exec, layer: usize, qkv: &[f32], out: &mut [f32]) {
        self.rows.attend(exec, layer, &mut self.cache, qkv, out);
    }

    /// A token whose gaze is not guided is the same in both conditional branches: copies its keys
    /// and values.
    pub(super) fn mirror_gaze_branch(&mut self, history: &History, slot: usize, token: u64) {
        let branch = self.gaze && self.branches(slot) == Branches::Guided;
        if branch && !history.condition(token).guides_gaze() {
            let (from, to) = (self.ring(slot, NO_GAZE), self.ring(slot, GAZE));
            (0..self.layers).for_each(|layer| self.cache.copy_token(from + layer, to + layer, token));
        }
    }

    /// Tokens before `end` are in the cache of slot `slot`.
    pub(super) fn commit(&mut self, slot: usize, end: u64) {
        self.slots[slot].committed = end;
    }

    /// Takes the prediction of the branches that were run, none if there was no new token; the
    /// others are the last of these.
    pub(super) fn take_x1(&mut self, x1: &[f32]) {
        let latent = self.x1.len() / PREDICTIONS;
        self.x1[..x1.len()].copy_from_slice(x1);
        if let Some(last) = x1.len().checked_sub(latent) {
            for at in (x1.len()..self.x1.len()).step_by(latent) {
                self.x1.copy_within(last..last + latent, at);
            }
        }
    }
}
