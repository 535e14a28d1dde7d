//! Integration of the flow from noise to a latent.

use super::condition::Condition;
use super::history::History;
use super::network::FlowNet;
use super::slots::{Branches, CHUNK, GAZE, NO_GAZE, Slots, UNCONDITIONAL};
use crate::config::CleanHistory;
use crate::frame::Sampler;
use crate::kernels::{Exec, KvDtype};

/// Guidance weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guidance {
    /// Weight of the conditioning: `x = x_0 + weight (x_c - x_0)`; 1 is none, 1.3 the paper's.
    pub weight: f32,
    /// Weight of the gaze target: `+ gaze (x_g - x_c)`; 2 to 3 makes the dial obeyed.
    pub gaze: f32,
}

/// What a generator is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeneratorOptions {
    /// The sampler that is meant to be used; Euler steps outside the grid of eighths get slots of their own.
    pub sampler: Sampler,
    /// Storage of the caches.
    pub dtype: KvDtype,
    /// Whether late evaluations of the reference network see history nearly clean; `None` imputes it throughout.
    pub clean_history: Option<CleanHistory>,
}

/// Receives each network evaluation: number of the evaluation, and x1 of each branch, `[branches, latent]`.
pub type X1Tap<'a> = &'a mut dyn FnMut(usize, &[f32]);

/// The reference network, its student, their caches and the history they share.
///
/// A sampler that has not been used for a while finds its slots behind; they catch up in batched passes when it is
/// used again.
#[derive(Debug)]
pub struct Generator {
    history: History,
    reference: Slots,
    student: Option<Slots>,
    taus: Vec<f32>,
    z: Vec<f32>,
    start: Vec<f32>,
    x1: Vec<f32>,
    eps: Vec<f32>,
}

/// Flow times of the reference sampler, midpoint with four steps; those of the cheaper midpoint rules and of Euler with
/// 1, 2, 4 or 8 steps are among them.
fn eighths() -> Vec<f32> {
    (0..8).map(|i| i as f32 / 8.0).collect()
}

impl Generator {
    /// Takes all memory. `student` pairs the network with the flow time at which it sees its history.
    pub fn new(
        exec: &mut Exec,
        net: &FlowNet,
        student: Option<(&FlowNet, f32)>,
        condition: &Condition,
        options: GeneratorOptions,
    ) -> Self {
        let mut taus = eighths();
        if let Sampler::Euler(steps) = options.sampler {
            taus.extend((0..steps).map(|i| f32::from(i) / f32::from(steps)).filter(|t| !eighths().contains(t)));
        }
        let pairs: Vec<_> = taus.iter().map(|t| (options.clean_history.map_or(*t, |c| c.time(*t)), *t)).collect();
        let (latent, window) = (net.latent(), net.config().window_blocks);
        let dtype = options.dtype;
        Self {
            history: History::new(window + CHUNK as usize + 1, latent, condition.layout()),
            reference: Slots::new(exec, net, &pairs, Branches::Guided, dtype),
            student: student.map(|(net, tau)| Slots::new(exec, net, &[(tau, 0.0)], Branches::Baked, dtype)),
            taus,
            z: vec![0.0; latent],
            start: vec![0.0; latent],
            x1: vec![0.0; latent],
            eps: vec![0.0; latent],
        }
    }

    /// Whether `sampler` can be used with the slots and networks at hand.
    pub fn supports(&self, sampler: Sampler) -> bool {
        match sampler {
            Sampler::Midpoint(n) => matches!(n, 1 | 2 | 4),
            Sampler::Euler(n) => n > 0 && (0..n).all(|i| self.taus.contains(&(f32::from(i) / f32::from(n)))),
            Sampler::Single => self.student.is_some(),
        }
    }

    /// Forgets all tokens; the next one gets the index `first`.
    pub fn reset(&mut self, first: u64) {
        self.history.reset(first);
        self.forget();
    }

    /// Forgets what the caches hold, which is what the network remembers; the tokens stay.
    pub fn forget(&mut self) {
        let next = self.history.len();
        self.reference.reset(next);
        self.student.iter_mut().for_each(|slots| slots.reset(next));
    }

    /// The tokens so far.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The tokens so far, to be replaced when re-anchoring.
    pub fn history_mut(&mut self) -> &mut History {
        &mut self.history
    }

    /// Bytes of all caches.
    pub fn cache_bytes(&self) -> usize {
        self.reference.cache_bytes() + self.student.as_ref().map_or(0, Slots::cache_bytes)
    }

    /// Appends a known latent (standardised) without sampling, for the start of a session. `noise` fills the token's
    /// noise, given its index.
    pub fn append(&mut self, condition: &Condition, z: &[f32], noise: impl FnOnce(u64, &mut [f32])) {
        let token = self.history.len();
        noise(token, self.history.begin(condition));
        self.history.finish(z);
    }

    /// Fills every slot with the history so far.
    pub fn warm_up(&mut self, exec: &mut Exec, net: &FlowNet, student: Option<&FlowNet>) {
        for slot in 0..self.reference.len() {
            self.reference.catch_up(exec, net, &self.history, slot);
        }
        if let (Some(slots), Some(net)) = (&mut self.student, student) {
            slots.catch_up(exec, net, &self.history, 0);
        }
    }

    /// Number of slots of both networks, those of the student last.
    pub fn slot_count(&self) -> usize {
        self.reference.len() + self.student.as_ref().map_or(0, Slots::len)
    }

    /// Computes a piece of slot `slot` anew from the history, as [`Slots::rewrite`]: tokens from `from` on, none before
    /// `oldest`; returns the token to go on with.
    pub fn rewrite(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        student: Option<&FlowNet>,
        slot: usize,
        oldest: u64,
        from: u64,
    ) -> Option<u64> {
        if slot < self.reference.len() {
            return self.reference.rewrite(exec, net, &self.history, slot, oldest, from);
        }
        let (slots, net) = self.student.as_mut().zip(student)?;
        slots.rewrite(exec, net, &self.history, slot - self.reference.len(), oldest, from)
    }

    /// Slots that `sampler` visits, in order; empty for one that is not supported.
    pub fn visits(&self, sampler: Sampler) -> impl Iterator<Item = usize> + '_ {
        let (steps, student) = match sampler {
            Sampler::Midpoint(n) => (2 * u16::from(n), None),
            Sampler::Euler(n) => (u16::from(n), None),
            Sampler::Single => (0, self.student.as_ref().map(|_| self.reference.len())),
        };
        let slot = move |i| self.taus.iter().position(|t| *t == f32::from(i) / f32::from(steps));
        (0..steps).filter_map(slot).chain(student)
    }

    /// Finished tokens that slot `slot` lacks; 1 when it was used for the last token.
    pub fn behind(&self, slot: usize) -> u64 {
        match slot.checked_sub(self.reference.len()) {
            None => self.reference.behind(slot, self.history.len()),
            Some(slot) => self.student.as_ref().map_or(0, |slots| slots.behind(slot, self.history.len())),
        }
    }

    /// Brings the slot of `sampler` that is furthest behind nearer to the present by one pass.
    pub fn catch_up(&mut self, exec: &mut Exec, net: &FlowNet, student: Option<&FlowNet>, sampler: Sampler) {
        let Some(slot) = self.visits(sampler).max_by_key(|slot| self.behind(*slot)) else { return };
        match slot.checked_sub(self.reference.len()) {
            None => self.reference.catch_up_once(exec, net, &self.history, slot),
            Some(slot) => {
                if let Some((slots, net)) = self.student.as_mut().zip(student) {
                    slots.catch_up_once(exec, net, &self.history, slot);
                }
            }
        }
    }

    /// Evaluates the network of `sampler` once for the token that would be next and keeps nothing of it: what a step takes
    /// can be measured without making motion.
    pub fn rehearse(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        student: Option<&FlowNet>,
        sampler: Sampler,
        condition: &Condition,
    ) {
        self.history.begin(condition).fill(0.0);
        self.z.fill(0.0);
        match (sampler, student, &mut self.student) {
            (Sampler::Single, Some(net), Some(slots)) => slots.rehearse(exec, net, &self.history, &self.z),
            _ => self.reference.rehearse(exec, net, &self.history, &self.z),
        }
    }

    /// Samples the latent of the next token, standardised, and appends it to the history.
    ///
    /// `noise` fills the token's noise, given its index. A sampler that is not supported falls back to the reference
    /// network's midpoint rule; sessions refuse such samplers before.
    #[allow(clippy::too_many_arguments, reason = "one call a block; a struct would only rename the arguments")]
    pub fn sample(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        student: Option<&FlowNet>,
        sampler: Sampler,
        guidance: Guidance,
        condition: &Condition,
        noise: impl FnOnce(u64, &mut [f32]),
        mut tap: Option<X1Tap<'_>>,
    ) -> &[f32] {
        let token = self.history.len();
        noise(token, self.history.begin(condition));
        self.eps.copy_from_slice(self.history.eps(token));
        self.z.copy_from_slice(&self.eps);
        match (sampler, student) {
            (Sampler::Single, Some(net)) => self.single(exec, net, &mut tap),
            (Sampler::Euler(steps), _) => self.euler(exec, net, usize::from(steps), guidance, &mut tap),
            (Sampler::Midpoint(steps), _) => self.midpoint(exec, net, usize::from(steps), guidance, &mut tap),
            (Sampler::Single, None) => self.midpoint(exec, net, 4, guidance, &mut tap),
        }
        self.history.finish(&self.z);
        &self.z
    }

    /// `z_mid = z + h/2 v(z, tau)`, `z += h v(z_mid, tau + h/2)` with `h = 1 / steps`.
    fn midpoint(&mut self, exec: &mut Exec, net: &FlowNet, steps: usize, g: Guidance, tap: &mut Option<X1Tap<'_>>) {
        let h = 1.0 / steps as f32;
        for i in 0..steps {
            let tau = i as f32 * h;
            self.start.copy_from_slice(&self.z);
            self.guided(exec, net, 2 * i, tau, g, tap);
            advance(&mut self.z, &self.start, &self.x1, 0.5 * h, tau);
            self.guided(exec, net, 2 * i + 1, tau + 0.5 * h, g, tap);
            advance(&mut self.z, &self.start, &self.x1, h, tau + 0.5 * h);
        }
    }

    /// `z += v(z, tau) / steps`.
    fn euler(&mut self, exec: &mut Exec, net: &FlowNet, steps: usize, g: Guidance, tap: &mut Option<X1Tap<'_>>) {
        for i in 0..steps {
            let tau = i as f32 / steps as f32;
            self.guided(exec, net, i, tau, g, tap);
            self.start.copy_from_slice(&self.z);
            advance(&mut self.z, &self.start, &self.x1, 1.0 / steps as f32, tau);
        }
    }

    fn single(&mut self, exec: &mut Exec, net: &FlowNet, tap: &mut Option<X1Tap<'_>>) {
        if let Some(slots) = &mut self.student {
            let x1 = slots.evaluate(exec, net, &self.history, 0, &self.z);
            if let Some(tap) = tap {
                tap(0, x1);
            }
            self.z.copy_from_slice(x1);
        }
    }

    /// Evaluates the network at `self.z` and leaves the guided x1 in `self.x1`.
    fn guided(&mut self, exec: &mut Exec, net: &FlowNet, n: usize, tau: f32, g: Guidance, tap: &mut Option<X1Tap<'_>>) {
        let slot = self.taus.iter().position(|t| *t == tau).unwrap_or(0);
        let x1 = self.reference.evaluate(exec, net, &self.history, slot, &self.z);
        if let Some(tap) = tap {
            tap(n, x1);
        }
        let latent = self.x1.len();
        let branch = |b: usize| &x1[b * latent..][..latent];
        let (x0, xc, xg) = (branch(UNCONDITIONAL), branch(NO_GAZE), branch(GAZE));
        for (((x, x0), xc), xg) in self.x1.iter_mut().zip(x0).zip(xc).zip(xg) {
            *x = x0 + g.weight * (xc - x0) + g.gaze * (xg - xc);
        }
    }
}

/// `z = start + h v` with the velocity `v = (x1 - z) / (1 - tau)` at `z`, where the network was evaluated.
fn advance(z: &mut [f32], start: &[f32], x1: &[f32], h: f32, tau: f32) {
    let k = h / (1.0 - tau);
    for ((z, start), x1) in z.iter_mut().zip(start).zip(x1) {
        *z = start + k * (x1 - *z);
    }
}
