//! Integration of the flow from noise to a latent.

use super::condition::Condition;
use super::history::History;
use super::network::FlowNet;
use super::shared::Part;
use super::slots::{Branches, CHUNK, GAZE, NO_GAZE, Slots, UNCONDITIONAL};
use crate::config::CleanHistory;
use crate::error::Result;
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

/// The networks that a generator runs, one of them at least.
#[derive(Debug, Clone, Copy)]
pub struct Nets<'a> {
    /// The network of all samplers with steps.
    pub reference: Option<&'a FlowNet>,
    /// That of the single-step sampler, and the flow time at which it sees its history.
    pub student: Option<(&'a FlowNet, f32)>,
}

impl<'a> Nets<'a> {
    /// The one that `sampler` runs, if it is there.
    pub fn of(self, sampler: Sampler) -> Option<&'a FlowNet> {
        if sampler == Sampler::Single { self.student() } else { self.reference }
    }

    fn student(self) -> Option<&'a FlowNet> {
        self.student.map(|(net, _)| net)
    }

    /// One of them, for what they have in common: sizes.
    ///
    /// # Panics
    /// When there is none.
    pub fn any(self) -> &'a FlowNet {
        self.reference.or(self.student()).expect("an engine has a network")
    }
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
    reference: Option<Slots>,
    student: Option<Slots>,
    taus: Vec<f32>,
    /// Sampler and guidance of the token being made.
    making: (Sampler, Guidance),
    z: Vec<f32>,
    start: Vec<f32>,
    x1: Vec<f32>,
}

/// Flow times of the reference sampler, midpoint with four steps; those of the cheaper midpoint rules and of Euler with
/// 1, 2, 4 or 8 steps are among them.
fn eighths() -> Vec<f32> {
    (0..8).map(|i| i as f32 / 8.0).collect()
}

/// Flow times of the reference network's slots for `sampler` and the midpoint rules: each slot's, as the history and the new token have it.
pub fn reference_times(sampler: Sampler, clean_history: Option<CleanHistory>) -> Vec<f32> {
    visited(sampler).into_iter().flat_map(|t| [clean_history.map_or(t, |c| c.time(t)), t]).collect()
}

/// The same of the student's, which sees its history at `tau_history`.
pub fn student_times(tau_history: f32) -> Vec<f32> {
    vec![tau_history, 0.0]
}

/// The eighths, and what `sampler` visits besides.
fn visited(sampler: Sampler) -> Vec<f32> {
    let mut taus = eighths();
    if let Sampler::Euler(steps) = sampler {
        taus.extend((0..steps).map(|i| f32::from(i) / f32::from(steps)).filter(|t| !eighths().contains(t)));
    }
    taus
}

impl Generator {
    /// Takes all memory.
    ///
    /// # Errors
    /// As [`FlowNet::modulation`].
    ///
    /// # Panics
    /// Without any network.
    pub fn new(exec: &mut Exec, nets: Nets<'_>, condition: &Condition, options: GeneratorOptions) -> Result<Self> {
        let GeneratorOptions { sampler, dtype, clean_history } = options;
        let any = nets.any();
        let (latent, window) = (any.latent(), any.config().window_blocks);
        let mut slots = |net, times: &[f32], branches| Slots::new(exec, net, times, branches, dtype);
        let reference = |net| slots(net, &reference_times(sampler, clean_history), Branches::Guided);
        let reference = nets.reference.map(reference).transpose()?;
        let student = nets.student.map(|(net, tau)| slots(net, &student_times(tau), Branches::Baked)).transpose()?;
        Ok(Self {
            history: History::new(window + CHUNK as usize + 1, latent, condition.layout()),
            reference,
            student,
            taus: visited(sampler),
            making: (sampler, Guidance { weight: 1.0, gaze: 0.0 }),
            z: vec![0.0; latent],
            start: vec![0.0; latent],
            x1: vec![0.0; latent],
        })
    }

    /// Whether `sampler` can be used with the slots and networks at hand.
    pub fn supports(&self, sampler: Sampler) -> bool {
        match sampler {
            Sampler::Midpoint(_) | Sampler::Euler(_) if self.reference.is_none() => false,
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
        self.reference.iter_mut().chain(&mut self.student).for_each(|slots| slots.reset(next));
    }

    /// The tokens so far.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The tokens so far, to be replaced when re-anchoring.
    pub fn history_mut(&mut self) -> &mut History {
        &mut self.history
    }

    /// Takes the memory that tokens with a gaze target need, which the first of them would take otherwise.
    pub fn open_gaze(&mut self) {
        self.reference.iter_mut().for_each(Slots::open_gaze);
    }

    /// Bytes of all caches in use.
    pub fn cache_bytes(&self) -> usize {
        self.reference.iter().chain(&self.student).map(Slots::cache_bytes).sum()
    }

    /// Appends a known latent (standardised) without sampling, for the start of a session. `noise` fills the token's
    /// noise, given its index.
    pub fn append(&mut self, condition: &Condition, z: &[f32], noise: impl FnOnce(u64, &mut [f32])) {
        let token = self.history.len();
        noise(token, self.history.begin(condition));
        self.history.finish(z);
    }

    /// Fills every slot with the history so far.
    pub fn warm_up(&mut self, exec: &mut Exec, nets: Nets<'_>) {
        for (slots, net) in [(&mut self.reference, nets.reference), (&mut self.student, nets.student())] {
            let Some((slots, net)) = slots.as_mut().zip(net) else { continue };
            (0..slots.len()).for_each(|slot| slots.catch_up(exec, net, &self.history, slot));
        }
    }

    /// Slots of the reference network.
    fn references(&self) -> usize {
        self.reference.as_ref().map_or(0, Slots::len)
    }

    /// The slots and the network that slot `slot` of all belongs to, and its number there.
    fn locate<'a, 'n>(
        reference: &'a mut Option<Slots>,
        student: &'a mut Option<Slots>,
        nets: Nets<'n>,
        slot: usize,
    ) -> Option<(&'a mut Slots, &'n FlowNet, usize)> {
        let before = reference.as_ref().map_or(0, Slots::len);
        match slot.checked_sub(before) {
            None => Some((reference.as_mut()?, nets.reference?, slot)),
            Some(slot) => Some((student.as_mut()?, nets.student()?, slot)),
        }
    }

    /// Number of slots of both networks, those of the student last.
    pub fn slot_count(&self) -> usize {
        self.references() + self.student.as_ref().map_or(0, Slots::len)
    }

    /// Computes a piece of slot `slot` anew from the history, as [`Slots::rewrite`]: tokens from `from` on, none before
    /// `oldest`; returns the token to go on with.
    pub fn rewrite(&mut self, exec: &mut Exec, nets: Nets<'_>, slot: usize, oldest: u64, from: u64) -> Option<u64> {
        let (slots, net, slot) = Self::locate(&mut self.reference, &mut self.student, nets, slot)?;
        slots.rewrite(exec, net, &self.history, slot, oldest, from)
    }

    /// Slots that `sampler` visits, in order; empty for one that is not supported.
    pub fn visits(&self, sampler: Sampler) -> impl Iterator<Item = usize> + '_ {
        let (steps, student) = match sampler {
            Sampler::Midpoint(_) | Sampler::Euler(_) if self.reference.is_none() => (0, None),
            Sampler::Midpoint(n) => (2 * u16::from(n), None),
            Sampler::Euler(n) => (u16::from(n), None),
            Sampler::Single => (0, self.student.as_ref().map(|_| self.references())),
        };
        let slot = move |i| self.taus.iter().position(|t| *t == f32::from(i) / f32::from(steps));
        (0..steps).filter_map(slot).chain(student)
    }

    /// Finished tokens that slot `slot` lacks; 1 when it was used for the last token.
    pub fn behind(&self, slot: usize) -> u64 {
        let (slots, slot) = match slot.checked_sub(self.references()) {
            None => (&self.reference, slot),
            Some(slot) => (&self.student, slot),
        };
        slots.as_ref().map_or(0, |slots| slots.behind(slot, self.history.len()))
    }

    /// Brings the slot of `sampler` that is furthest behind nearer to the present by one pass.
    pub fn catch_up(&mut self, exec: &mut Exec, nets: Nets<'_>, sampler: Sampler) {
        let Some(slot) = self.visits(sampler).max_by_key(|slot| self.behind(*slot)) else { return };
        if let Some((slots, net, slot)) = Self::locate(&mut self.reference, &mut self.student, nets, slot) {
            slots.catch_up_once(exec, net, &self.history, slot);
        }
    }

    /// Evaluates the network of `sampler` once for the token that would be next and keeps nothing of it: what a step takes
    /// can be measured without making motion.
    pub fn rehearse(&mut self, exec: &mut Exec, nets: Nets<'_>, sampler: Sampler, condition: &Condition) {
        self.history.begin(condition).fill(0.0);
        self.z.fill(0.0);
        let slots = if sampler == Sampler::Single { &mut self.student } else { &mut self.reference };
        if let Some((slots, net)) = slots.as_mut().zip(nets.of(sampler)) {
            slots.rehearse(exec, net, &self.history, &self.z);
        }
    }

    /// Samples the latent of the next token, standardised, and appends it to the history.
    ///
    /// `noise` fills the token's noise, given its index. A sampler that is not supported falls back to the midpoint rule, or
    /// without the reference network to a single step; sessions refuse such samplers before.
    #[allow(clippy::too_many_arguments, reason = "one call a block; a struct would only rename the arguments")]
    pub fn sample(
        &mut self,
        exec: &mut Exec,
        nets: Nets<'_>,
        sampler: Sampler,
        guidance: Guidance,
        condition: &Condition,
        noise: impl FnOnce(u64, &mut [f32]),
        mut tap: Option<X1Tap<'_>>,
    ) -> &[f32] {
        self.begin(sampler, guidance, condition, noise);
        for i in 0..self.evaluations() {
            let slot = self.slot(i);
            let slots = if self.is_single() { &mut self.student } else { &mut self.reference };
            let Some((slots, net)) = slots.as_mut().zip(nets.of(self.making.0)) else { continue };
            let x1 = slots.evaluate(exec, net, &self.history, slot, &self.z);
            if let Some(tap) = &mut tap {
                tap(i, x1);
            }
            self.step(i);
        }
        self.finish()
    }

    /// Starts making the next token from its noise.
    pub(super) fn begin(
        &mut self,
        sampler: Sampler,
        guidance: Guidance,
        condition: &Condition,
        noise: impl FnOnce(u64, &mut [f32]),
    ) {
        let token = self.history.len();
        noise(token, self.history.begin(condition));
        self.z.copy_from_slice(self.history.eps(token));
        let other = if self.reference.is_some() { Sampler::Midpoint(4) } else { Sampler::Single };
        let sampler = if self.supports(sampler) { sampler } else { other };
        self.making = (sampler, guidance);
    }

    /// Evaluations of the network that the token being made takes.
    pub(super) fn evaluations(&self) -> usize {
        self.making.0.evaluations()
    }

    /// What makes the token.
    pub(super) fn sampler(&self) -> Sampler {
        self.making.0
    }

    /// Whether the student makes the token.
    fn is_single(&self) -> bool {
        self.making.0 == Sampler::Single
    }

    /// Flow time of evaluation `i` and length of a step.
    fn time(&self, i: usize) -> (f32, f32) {
        match self.making.0 {
            Sampler::Midpoint(steps) => {
                let h = 1.0 / f32::from(steps);
                let tau = (i / 2) as f32 * h;
                (if i.is_multiple_of(2) { tau } else { tau + 0.5 * h }, h)
            }
            Sampler::Euler(steps) => (i as f32 / f32::from(steps), 1.0 / f32::from(steps)),
            Sampler::Single => (0.0, 1.0),
        }
    }

    /// Slot of evaluation `i` within its network's.
    pub(super) fn slot(&self, i: usize) -> usize {
        if self.is_single() {
            return 0;
        }
        let (tau, _) = self.time(i);
        self.taus.iter().position(|t| *t == tau).unwrap_or(0)
    }

    /// Goes on with what evaluation `i` predicted.
    ///
    /// Midpoint: `z_mid = z + h/2 v(z, tau)`, `z += h v(z_mid, tau + h/2)` with `h = 1 / steps`. Euler: `z += v(z, tau) / steps`.
    pub(super) fn step(&mut self, i: usize) {
        if let (Sampler::Single, Some(slots)) = (self.making.0, &self.student) {
            return self.z.copy_from_slice(slots.x1());
        }
        let Some(slots) = &self.reference else { return };
        let (x1, g) = (slots.x1(), self.making.1);
        let latent = self.x1.len();
        let branch = |b: usize| &x1[b * latent..][..latent];
        let (x0, xc, xg) = (branch(UNCONDITIONAL), branch(NO_GAZE), branch(GAZE));
        for (((x, x0), xc), xg) in self.x1.iter_mut().zip(x0).zip(xc).zip(xg) {
            *x = x0 + g.weight * (xc - x0) + g.gaze * (xg - xc);
        }
        let (tau, h) = self.time(i);
        let midpoint = matches!(self.making.0, Sampler::Midpoint(_));
        if !midpoint || i.is_multiple_of(2) {
            self.start.copy_from_slice(&self.z);
        }
        let h = if midpoint && i.is_multiple_of(2) { 0.5 * h } else { h };
        advance(&mut self.z, &self.start, &self.x1, h, tau);
    }

    /// Appends the token to the history.
    pub(super) fn finish(&mut self) -> &[f32] {
        self.history.finish(&self.z);
        &self.z
    }

    /// This generator's part in a shared pass.
    pub(super) fn part(&mut self) -> Option<Part<'_>> {
        let slots = if self.is_single() { &mut self.student } else { &mut self.reference };
        Some(Part { slots: slots.as_mut()?, history: &self.history, z: &self.z })
    }

    /// Rows of one evaluation of `sampler` for the next token, with or without a gaze target; `None` where slots must catch up first
    /// or the sampler is not supported.
    pub fn rows(&self, sampler: Sampler, gaze: bool) -> Option<usize> {
        if !self.supports(sampler) || self.visits(sampler).any(|slot| self.behind(slot) > 1) {
            return None;
        }
        let last = self.history.len().checked_sub(1).filter(|_| !self.history.is_empty());
        let gaze = gaze || last.is_some_and(|token| self.history.condition(token).guides_gaze());
        Some(2 * if sampler == Sampler::Single { 1 } else { 2 + usize::from(gaze) })
    }

    /// Whether rows of `sampler` of both can share passes: slots at the same flow times.
    pub fn alike(&self, other: &Generator, sampler: Sampler) -> bool {
        match (sampler, &self.student, &other.student, &self.reference, &other.reference) {
            (Sampler::Single, Some(a), Some(b), ..) => a.alike(b),
            (_, _, _, Some(a), Some(b)) => a.alike(b) && self.taus == other.taus,
            _ => false,
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
