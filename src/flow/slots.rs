//! One key-value cache a flow time, and the passes that fill and use them.
//!
//! Rings are numbered `(slot * branches + branch) * layers + layer`; those of the gaze branch come after all others, and are not
//! touched, hence take no memory, before there is a gaze target: until then the branch is the one without. Position `t` of a ring holds token `t`. A pass
//! writes the new token's keys and values too; they are provisional, and the next pass over that position, when the
//! token is finished, overwrites them.

use super::history::History;
use super::modulation::Modulation;
use super::network::FlowNet;
use crate::error::Result;
use crate::kernels::{Epilogue, Exec, KvCache, KvDtype};
use crate::nn::{Phases, Rows, Scratch};
use std::ops::Range;
use std::sync::Arc;

/// Finished tokens that one pass commits at most.
pub(super) const CHUNK: u64 = 8;

/// Guidance branches that a network is run with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branches {
    /// Unconditional, conditional without the gaze target, and conditional with it.
    Guided,
    /// Conditional alone, gaze target included when set: guidance is distilled into the weights.
    Baked,
}

impl Branches {
    /// Number of branches.
    pub fn count(self) -> usize {
        match self {
            Branches::Guided => 3,
            Branches::Baked => 1,
        }
    }
}

/// Branch numbers of [`Branches::Guided`].
pub(super) const UNCONDITIONAL: usize = 0;
pub(super) const NO_GAZE: usize = 1;
pub(super) const GAZE: usize = 2;

/// A slot: the flow times at which its history and its new token are seen, and how far its cache is filled.
#[derive(Debug, Clone, Copy)]
struct Slot {
    tau_history: f32,
    /// Tokens before this are in the cache.
    committed: u64,
    /// Tokens from this on are in the cache without a gap.
    start: u64,
}

/// The slots of one network and all memory that its passes need.
#[derive(Debug)]
pub struct Slots {
    branches: Branches,
    slots: Vec<Slot>,
    modulation: Arc<Modulation>,
    cache: KvCache,
    /// Whether the gaze branch has rings of its own.
    gaze: bool,
    layers: usize,
    window: u64,
    /// Projected conditioning of the last tokens, `[token % capacity][2][d]`.
    projected: Vec<f32>,
    projected_capacity: u64,
    projected_end: u64,
    embedded: Vec<f32>,
    rows: Rows,
    mod_index: Vec<u32>,
    phases: Phases,
    scratch: Scratch,
    z: Vec<f32>,
    z_in: Vec<f32>,
    x: Vec<f32>,
    tail: Vec<f32>,
    x1: Vec<f32>,
}

impl Slots {
    /// Slots for flow times, in turns those of the history and of the new token.
    ///
    /// # Errors
    /// As [`FlowNet::modulation`].
    pub fn new(exec: &mut Exec, net: &FlowNet, taus: &[f32], branches: Branches, dtype: KvDtype) -> Result<Self> {
        let c = net.config();
        let (d, latent, window) = (c.width, net.latent(), c.window_blocks as u64);
        let rows = (CHUNK as usize + 1) * branches.count();
        let capacity = window + CHUNK;
        let slots: Vec<_> =
            taus.iter().step_by(2).map(|tau| Slot { tau_history: *tau, committed: 0, start: 0 }).collect();
        Ok(Self {
            branches,
            modulation: net.modulation(exec, taus)?,
            cache: KvCache::new(slots.len() * branches.count() * c.layers, capacity as usize, c.heads, d, dtype),
            slots,
            gaze: false,
            layers: c.layers,
            window,
            projected: vec![0.0; (capacity as usize + 1) * 2 * d],
            projected_capacity: capacity + 1,
            projected_end: 0,
            embedded: vec![0.0; 2 * net.rest_width()],
            rows: Rows::with_capacity(rows),
            mod_index: Vec::with_capacity(rows),
            phases: net.rope.phases(rows),
            scratch: Scratch::new(rows, d, d * c.mlp),
            z: vec![0.0; (CHUNK as usize + 1) * latent],
            z_in: vec![0.0; (CHUNK as usize + 1) * d],
            x: vec![0.0; rows * d],
            tail: vec![0.0; branches.count() * d],
            x1: vec![0.0; branches.count() * latent],
        })
    }

    /// Forgets all tokens; the next one has the index `next`.
    pub fn reset(&mut self, next: u64) {
        self.projected_end = next;
        self.slots.iter_mut().for_each(|s| (s.committed, s.start) = (next, next));
    }

    /// Whether rows of the same slots of `self` and `other` can go through the layers together: modulation is the same.
    pub(super) fn alike(&self, other: &Slots) -> bool {
        let same = |(a, b): (&Slot, &Slot)| a.tau_history.to_bits() == b.tau_history.to_bits();
        let paired = self.slots.len() == other.slots.len() && self.slots.iter().zip(&other.slots).all(same);
        paired && self.branches == other.branches
    }

    /// Bytes of the caches that are in use.
    pub fn cache_bytes(&self) -> usize {
        match self.branches {
            Branches::Guided if !self.gaze => self.cache.bytes() / 3 * 2,
            _ => self.cache.bytes(),
        }
    }

    /// Number of slots.
    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }

    /// Brings slot `slot` up to the finished tokens of `history`.
    pub fn catch_up(&mut self, exec: &mut Exec, net: &FlowNet, history: &History, slot: usize) {
        let end = history.len();
        while self.pending(slot, end) > 0 {
            let first = self.slots[slot].committed;
            self.pass(exec, net, history, slot, first..end.min(first + CHUNK), None);
        }
    }

    /// Brings slot `slot` nearer to the finished tokens of `history` by one pass.
    pub fn catch_up_once(&mut self, exec: &mut Exec, net: &FlowNet, history: &History, slot: usize) {
        let end = history.len();
        if self.pending(slot, end) > 0 {
            let first = self.slots[slot].committed;
            self.pass(exec, net, history, slot, first..end.min(first + CHUNK), None);
        }
    }

    /// Finished tokens that slot `slot` lacks, a window at most, when `end` tokens are finished.
    pub fn behind(&self, slot: usize, end: u64) -> u64 {
        (end - self.slots[slot].committed.min(end)).min(self.window)
    }

    /// Computes the keys and values of tokens `from..` (at most `CHUNK` of them, none before `oldest`) of slot `slot` anew,
    /// in place, seeing nothing before `oldest`; returns the token to go on with, or `None` when the slot is through.
    /// The rest of the slot stays as it is, so it can be used between two of these passes.
    pub fn rewrite(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        slot: usize,
        oldest: u64,
        from: u64,
    ) -> Option<u64> {
        let Slot { committed, start, .. } = self.slots[slot];
        let window_start = history.len().saturating_sub(self.window);
        let from = from.max(oldest).max(window_start).max(start);
        let to = committed.min(from + CHUNK);
        if from >= to {
            return None;
        }
        self.slots[slot].start = oldest.max(start);
        self.pass(exec, net, history, slot, from..to, None);
        self.slots[slot].committed = committed;
        self.slots[slot].start = start;
        (to < committed).then_some(to)
    }

    /// x1 predictions for the new token at `z`, `[branches, latent]`, over the history that slot `slot` holds; what the
    /// slot lacks is caught up first. Where gaze is not guided, the gaze branch equals the one without.
    pub fn evaluate(&mut self, exec: &mut Exec, net: &FlowNet, history: &History, slot: usize, z: &[f32]) -> &[f32] {
        let end = history.len();
        while self.pending(slot, end) > CHUNK {
            let first = self.slots[slot].committed;
            self.pass(exec, net, history, slot, first..first + CHUNK, None);
        }
        let first = self.slots[slot].committed;
        self.pass(exec, net, history, slot, first..end, Some(z));
        &self.x1
    }

    /// Stages an evaluation at `z` of a slot that lacks one token at most; returns the number of rows.
    pub(super) fn stage_next(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        slot: usize,
        z: &[f32],
    ) -> usize {
        let end = history.len();
        self.pending(slot, end);
        let first = self.slots[slot].committed;
        self.stage(exec, net, history, slot, first..end, Some(z));
        self.rows.len()
    }

    /// Copies the staged rows, and the number of the modulation of each.
    pub(super) fn hand_over(&self, rows: usize, d: usize, x: &mut [f32], index: &mut Vec<u32>) {
        x[..rows * d].copy_from_slice(&self.x[..rows * d]);
        index.extend_from_slice(&self.mod_index);
    }

    pub(super) fn phases(&self) -> &Phases {
        &self.phases
    }

    pub(super) fn modulation(&self) -> Arc<Modulation> {
        Arc::clone(&self.modulation)
    }

    /// The attention of the staged rows in layer `layer`; returns their number.
    pub(super) fn attend(&mut self, exec: &mut Exec, layer: usize, qkv: &[f32], out: &mut [f32]) -> usize {
        let (n, d) = (self.rows.len(), self.cache.dim());
        self.rows.attend(exec, layer, &mut self.cache, &qkv[..n * 3 * d], &mut out[..n * d]);
        n
    }

    /// Takes the staged rows as they came out of the last layer; returns their number. The prediction is in [`Slots::x1`].
    pub(super) fn take_back(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        slot: usize,
        x: &[f32],
    ) -> usize {
        let (n, d) = (self.rows.len(), net.config().width);
        self.x[..n * d].copy_from_slice(&x[..n * d]);
        self.finish(exec, net, history, slot, self.slots[slot].committed..history.len(), true);
        n
    }

    /// Prediction of the last evaluation, `[branches, latent]`.
    pub(super) fn x1(&self) -> &[f32] {
        &self.x1
    }

    /// Evaluates slot 0 for the new token and forgets it again.
    pub fn rehearse(&mut self, exec: &mut Exec, net: &FlowNet, history: &History, z: &[f32]) {
        self.evaluate(exec, net, history, 0, z);
        // The token's conditioning will be another one when it is made.
        self.projected_end = self.projected_end.min(history.len());
    }

    /// Tokens that slot `slot` lacks. One that lags by more than a window starts anew a window back.
    fn pending(&mut self, slot: usize, end: u64) -> u64 {
        let oldest = end.saturating_sub(self.window);
        let s = &mut self.slots[slot];
        if s.committed < oldest {
            (s.start, s.committed) = (oldest, oldest);
        }
        end - s.committed
    }

    /// Runs tokens `commit` (finished; at most [`CHUNK`]) and, with `new`, the token being made.
    fn pass(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        slot: usize,
        commit: Range<u64>,
        new: Option<&[f32]>,
    ) {
        self.stage(exec, net, history, slot, commit.clone(), new);
        let Self { modulation, mod_index, cache, rows, phases, scratch, x, .. } = &mut *self;
        net.run(exec, modulation, mod_index, phases, rows.len(), scratch, x, &mut |exec, layer, qkv, out| {
            rows.attend(exec, layer, cache, qkv, out);
        });
        self.finish(exec, net, history, slot, commit, new.is_some());
    }

    /// Fills the rows of a pass: what [`Slots::pass`] runs through the layers.
    fn stage(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        slot: usize,
        commit: Range<u64>,
        new: Option<&[f32]>,
    ) {
        let (d, latent) = (net.config().width, net.latent());
        let tau = self.slots[slot].tau_history;
        let tokens = commit.start..commit.end + u64::from(new.is_some());
        let count = (tokens.end - tokens.start) as usize;
        for token in tokens.clone() {
            self.project(exec, net, history, token);
            let z = &mut self.z[(token - tokens.start) as usize * latent..][..latent];
            match new {
                Some(z_new) if token == commit.end => z.copy_from_slice(z_new),
                _ => impute(tau, history.z(token), history.eps(token), z),
            }
        }
        net.embed_latent(exec, &self.z[..count * latent], count, &mut self.z_in[..count * d]);

        self.rows.clear();
        self.mod_index.clear();
        let start = self.slots[slot].start;
        if tokens.clone().any(|token| history.condition(token).guides_gaze()) {
            self.open_gaze();
        }
        for token in tokens.clone() {
            let is_new = token == commit.end;
            for branch in self.active(history, token) {
                let row = self.rows.len();
                let first = (token + 1).saturating_sub(self.window).max(start);
                self.rows.push(self.ring(slot, branch), token, first);
                self.mod_index.push((2 * slot + usize::from(is_new)) as u32);
                net.rope.fill(&mut self.phases, row, token);
                let projected = &self.projected[self.projected_at(token, d)..][..2 * d];
                let conditioning = match (self.branches, branch) {
                    (Branches::Guided, UNCONDITIONAL) => net.unconditional(),
                    (Branches::Guided, NO_GAZE) => &projected[..d],
                    _ => &projected[d..],
                };
                let z_in = &self.z_in[(token - tokens.start) as usize * d..][..d];
                let x = &mut self.x[row * d..][..d];
                x.iter_mut().zip(z_in).zip(conditioning).for_each(|((x, a), b)| *x = a + b);
            }
        }
    }

    /// What follows the layers of a pass.
    fn finish(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        history: &History,
        slot: usize,
        commit: Range<u64>,
        new: bool,
    ) {
        for token in commit.start..commit.end + u64::from(new) {
            self.mirror_gaze_branch(history, slot, token);
        }
        self.slots[slot].committed = commit.end;
        if new {
            self.read_out(exec, net, history.condition(commit.end).guides_gaze());
        }
    }

    /// Branches that are run for `token`: the gaze branch only where a target is guided towards.
    fn active(&self, history: &History, token: u64) -> Range<usize> {
        match self.branches {
            Branches::Baked => 0..1,
            Branches::Guided if history.condition(token).guides_gaze() => 0..3,
            Branches::Guided => 0..2,
        }
    }

    /// A token whose gaze is not guided is the same in both conditional branches: copies its keys and values.
    fn mirror_gaze_branch(&mut self, history: &History, slot: usize, token: u64) {
        if self.gaze && !history.condition(token).guides_gaze() {
            let (from, to) = (self.ring(slot, NO_GAZE), self.ring(slot, GAZE));
            (0..self.layers).for_each(|layer| self.cache.copy_token(from + layer, to + layer, token));
        }
    }

    /// Final norm and projection of the new token's rows, which are the last ones of the pass.
    fn read_out(&mut self, exec: &mut Exec, net: &FlowNet, guided: bool) {
        let (d, latent, rows) = (net.config().width, net.latent(), self.rows.len());
        let n = if self.branches == Branches::Guided && !guided { 2 } else { self.branches.count() };
        let index = &self.mod_index[rows - n..];
        let (shift, scale) = self.modulation.last(index);
        exec.norm(&self.x[(rows - n) * d..rows * d], n, d, shift, scale, &mut self.tail[..n * d]);
        exec.linear(&net.out, &self.tail[..n * d], n, &mut self.x1[..n * latent], Epilogue::Store);
        if n == 2 {
            self.x1.copy_within(NO_GAZE * latent..(NO_GAZE + 1) * latent, GAZE * latent);
        }
    }

    /// Projects the conditioning of `token` unless it has been; tokens come in order.
    fn project(&mut self, exec: &mut Exec, net: &FlowNet, history: &History, token: u64) {
        if token < self.projected_end && token + self.projected_capacity > self.projected_end {
            return;
        }
        let (d, at) = (net.config().width, self.projected_at(token, net.config().width));
        net.project(exec, history.condition(token), &mut self.embedded, &mut self.projected[at..][..2 * d]);
        self.projected_end = token + 1;
    }

    fn projected_at(&self, token: u64, d: usize) -> usize {
        (token % self.projected_capacity) as usize * 2 * d
    }

    fn ring(&self, slot: usize, branch: usize) -> usize {
        let (slots, count) = (self.slots.len(), self.branches.count());
        let number = match (self.branches, branch) {
            (Branches::Guided, GAZE) => slots * (count - 1) + slot,
            (Branches::Guided, _) => slot * (count - 1) + branch,
            (Branches::Baked, _) => slot,
        };
        number * self.layers
    }

    /// Gives the gaze branch rings of its own, with what the branch without a target holds.
    pub(super) fn open_gaze(&mut self) {
        if self.gaze || self.branches == Branches::Baked {
            return;
        }
        self.gaze = true;
        for slot in 0..self.slots.len() {
            let (from, to) = (self.ring(slot, NO_GAZE), self.ring(slot, GAZE));
            (0..self.layers).for_each(|layer| self.cache.copy_ring(from + layer, to + layer));
        }
    }
}

/// `z^tau = tau z + (1 - tau) eps` (SARAH eq. 4).
fn impute(tau: f32, z: &[f32], eps: &[f32], out: &mut [f32]) {
    for ((o, z), e) in out.iter_mut().zip(z).zip(eps) {
        *o = tau * z + (1.0 - tau) * e;
    }
}
