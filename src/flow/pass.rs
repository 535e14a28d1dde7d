//! Passes through a flow network: tokens of one generator, or of several side by side, go through
//! each layer together, which reads its weights once.

use super::history::History;
use super::nets::Nets;
use super::network::FlowNet;
use super::schedule::Branches;
use super::slots::{CHUNK, NO_GAZE, ROWS, Slots, UNCONDITIONAL};
use crate::kernels::Exec;
use crate::nn::Pass;
use std::ops::Range;
use std::sync::Arc;

/// Rows of a pass that generators share, at most: as many as a product of the kernels takes at
/// once.
pub const SHARED_ROWS: usize = 16;

/// Working memory of passes through networks of one size.
#[derive(Debug)]
pub struct Work {
    pass: Pass,
    /// Tokens of one part: their latents at a flow time, and these embedded.
    z: Vec<f32>,
    z_in: Vec<f32>,
    embedded: Vec<f32>,
    /// Predictions of all parts.
    out: Vec<f32>,
}

/// What generators are run with: threads, working memory and networks.
#[derive(Debug)]
pub struct Tools<'a> {
    /// Threads and kernels.
    pub exec: &'a mut Exec,
    /// Working memory.
    pub work: &'a mut Work,
    /// The networks.
    pub nets: Nets<'a>,
}

/// What a generator has to do in a pass over one of its slots.
pub(super) struct Part<'a> {
    pub(super) slots: &'a mut Slots,
    pub(super) history: &'a History,
    pub(super) slot: usize,
    /// Finished tokens that are committed, at most [`CHUNK`].
    pub(super) commit: Range<u64>,
    /// The token being made, which comes after them.
    pub(super) new: Option<&'a [f32]>,
}

impl Work {
    /// For passes of `net`.
    pub fn new(net: &FlowNet) -> Self {
        let tokens = CHUNK as usize + 1;
        Self {
            pass: net.pass(ROWS),
            z: vec![0.0; tokens * net.latent()],
            z_in: vec![0.0; tokens * net.config().width],
            embedded: vec![0.0; net.scratch()],
            out: vec![0.0; SHARED_ROWS * net.latent()],
        }
    }

    /// Runs a pass of one part.
    pub(super) fn run_one(&mut self, exec: &mut Exec, net: &FlowNet, part: Part<'_>) {
        self.run(exec, net, &mut [part], |part| Some(part.borrowed()));
    }

    /// Runs a pass of the parts of all `members` that have one. They are of slots at the same flow
    /// times ([`Slots::alike`]), and several of them have [`SHARED_ROWS`] rows at most. Predictions
    /// are in [`Slots::x1`] afterwards.
    pub(super) fn run<M>(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        members: &mut [M],
        part: impl for<'a> Fn(&'a mut M) -> Option<Part<'a>> + Copy,
    ) {
        let d = net.config().width;
        self.pass.clear();
        let mut modulation = None;
        for mut part in members.iter_mut().filter_map(part) {
            part.stage(exec, net, self);
            modulation.get_or_insert_with(|| Arc::clone(part.slots.modulation()));
        }
        let Some(modulation) = modulation else { return };
        let Self { pass, out, .. } = self;
        // The next pass begins with the first layer again.
        pass.run(exec, net.layers(), &*modulation, net.layers().first(), &mut |exec, layer, qkv, out| {
            let mut from = 0;
            for part in members.iter_mut().filter_map(part) {
                let n = part.slots.rows();
                part.slots.attend(exec, layer, &qkv[from * 3 * d..][..n * 3 * d], &mut out[from * d..][..n * d]);
                from += n;
            }
        });
        let mut end = 0;
        for mut part in members.iter_mut().filter_map(part) {
            end += part.slots.rows();
            part.finish();
            let read = part.read();
            pass.read(exec, &*modulation, end - read..end);
        }
        let mut x1 = pass.project(exec, net.out(), out);
        for part in members.iter_mut().filter_map(part) {
            let (own, others) = x1.split_at(part.read() * net.latent());
            part.slots.take_x1(own);
            x1 = others;
        }
    }
}

impl Part<'_> {
    /// The same for a shorter time.
    fn borrowed(&mut self) -> Part<'_> {
        let Self { slots, history, slot, commit, new } = self;
        Part { slots, history, slot: *slot, commit: commit.clone(), new: *new }
    }

    /// All tokens: those that are committed, and the new one.
    fn tokens(&self) -> Range<u64> {
        self.commit.start..self.commit.end + u64::from(self.new.is_some())
    }

    /// Adds the rows of its tokens to the pass, one for each branch that a token has.
    fn stage(&mut self, exec: &mut Exec, net: &FlowNet, work: &mut Work) {
        let (d, latent) = (net.config().width, net.latent());
        let Work { pass, z, z_in, embedded, .. } = work;
        let tokens = self.tokens();
        let Self { slots, history, slot, commit, new } = self;
        let slot = *slot;
        let count = (tokens.end - tokens.start) as usize;
        let tau = slots.tau_history(slot);
        for (token, z) in tokens.clone().zip(z.chunks_exact_mut(latent)) {
            slots.project(exec, net, history, token, embedded);
            match new {
                Some(new) if token == commit.end => z.copy_from_slice(new),
                _ => impute(tau, history.z(token), history.eps(token), z),
            }
        }
        net.embed_latent(exec, &z[..count * latent], count, &mut z_in[..count * d]);

        slots.begin_rows(tokens.clone().any(|token| history.condition(token).guides_gaze()));
        for (token, z_in) in tokens.zip(z_in.chunks_exact(d)) {
            let modulation = 2 * slot + usize::from(token == commit.end);
            for branch in slots.active(slot, history, token) {
                slots.push_row(slot, branch, token);
                let [unconditional, without, with] = slots.projected(token);
                let conditioning = match (slots.branches(slot), branch) {
                    (Branches::Guided, UNCONDITIONAL) => unconditional,
                    (Branches::Guided, NO_GAZE) => without,
                    _ => with,
                };
                let x = pass.push(net.rope(), token, modulation as u32);
                x.iter_mut().zip(z_in).zip(conditioning).for_each(|((x, a), b)| *x = a + b);
            }
        }
    }

    /// What follows the layers.
    fn finish(&mut self) {
        for token in self.tokens() {
            self.slots.mirror_gaze_branch(self.history, self.slot, token);
        }
        self.slots.commit(self.slot, self.commit.end);
    }

    /// How many of its rows, the last ones, are the new token's, and are read out.
    fn read(&self) -> usize {
        self.new.map_or(0, |_| self.slots.active(self.slot, self.history, self.commit.end).len())
    }
}

/// `z^tau = tau z + (1 - tau) eps` (SARAH eq. 4).
fn impute(tau: f32, z: &[f32], eps: &[f32], out: &mut [f32]) {
    for ((o, z), e) in out.iter_mut().zip(z).zip(eps) {
        *o = tau * z + (1.0 - tau) * e;
    }
}
