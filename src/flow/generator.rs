//! A generator: what one session's networks remember, and how much of it is up to date.

use super::condition::Condition;
use super::history::History;
use super::making::Making;
use super::nets::{Guidance, Nets};
use super::network::FlowNet;
use super::pass::Tools;
use super::schedule::{Branches, Schedule, reference_slots, student_slots};
use super::slots::{CHUNK, Slots};
use super::upkeep::Stretch;
use crate::config::CleanHistory;
use crate::error::Result;
use crate::frame::Sampler;
use crate::kernels::{Exec, KvDtype};
use crate::normaliser::Standardised;

/// What a generator is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeneratorOptions {
    /// The sampler that is meant to be used; Euler steps outside the grid of eighths get slots of
    /// their own.
    pub sampler: Sampler,
    /// Storage of the caches.
    pub dtype: KvDtype,
    /// Whether late evaluations of the reference network see history nearly clean; `None` imputes
    /// it throughout.
    pub clean_history: Option<CleanHistory>,
    /// Flow time from which evaluations of the reference network are conditional alone; `None`
    /// guides all.
    pub guided_until: Option<f32>,
}

/// The history of one session, and the caches of the reference network and its student over it.
///
/// Slots of both networks are numbered through, those of the student last. A sampler that has not
/// been used for a while finds its slots behind; they catch up in batched passes when it is used
/// again.
#[derive(Debug)]
pub struct Generator {
    pub(super) history: History,
    pub(super) reference: Option<Slots>,
    pub(super) student: Option<Slots>,
    schedule: Schedule,
    /// The token being made.
    pub(super) making: Making,
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
        let GeneratorOptions { sampler, dtype, clean_history, guided_until } = options;
        let any = nets.any();
        let (latent, window) = (any.latent(), any.config().window_blocks);
        let mut slots = |net, times: &[_]| Slots::new(exec, net, times, dtype);
        let reference = |net| slots(net, &reference_slots(sampler, clean_history, guided_until));
        let reference = nets.reference.map(reference).transpose()?;
        let student = nets.student.map(|(net, tau)| slots(net, &student_slots(tau))).transpose()?;
        Ok(Self {
            history: History::new(window + CHUNK as usize + 1, latent, condition.layout()),
            reference,
            student,
            schedule: Schedule::new(sampler),
            making: Making::new(latent),
        })
    }

    /// Whether `sampler` can be used with the slots and networks at hand.
    pub fn supports(&self, sampler: Sampler) -> bool {
        match sampler {
            Sampler::Single => self.student.is_some(),
            _ => self.reference.is_some() && self.schedule.covers(sampler),
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

    /// Index of the token that is made next.
    pub fn next_token(&self) -> u64 {
        self.history.len()
    }

    /// Latent of a finished token.
    pub fn latent(&self, token: u64) -> Standardised<&[f32]> {
        Standardised::new(self.history.z(token))
    }

    /// Latent of the last finished token.
    pub fn last_latent(&self) -> Standardised<&[f32]> {
        self.latent(self.history.len() - 1)
    }

    /// Puts another latent in the place of a finished token's (re-anchoring, teacher forcing).
    pub fn replace(&mut self, token: u64, z: Standardised<&[f32]>) {
        self.history.replace(token, z.values());
    }

    /// Takes the memory that tokens with a gaze target need, which the first of them would take
    /// otherwise.
    pub fn open_gaze(&mut self) {
        self.reference.iter_mut().for_each(Slots::open_gaze);
    }

    /// Bytes of all caches in use.
    pub fn cache_bytes(&self) -> usize {
        self.reference.iter().chain(&self.student).map(Slots::cache_bytes).sum()
    }

    /// Appends a known latent without sampling, for the start of a session. `noise` fills the
    /// token's noise, given its index.
    pub fn append(&mut self, condition: &Condition, z: Standardised<&[f32]>, noise: impl FnOnce(u64, &mut [f32])) {
        let token = self.history.len();
        noise(token, self.history.begin(condition));
        self.history.finish(z.values());
    }

    /// Fills every slot with the history so far.
    pub fn warm_up(&mut self, tools: &mut Tools<'_>) {
        for slot in 0..self.slot_count() {
            while self.catch_up_slot(tools, slot) {}
        }
    }

    /// Slots of the reference network.
    fn references(&self) -> usize {
        self.reference.as_ref().map_or(0, Slots::count)
    }

    /// Number of slots of both networks.
    pub fn slot_count(&self) -> usize {
        self.references() + self.student.as_ref().map_or(0, Slots::count)
    }

    /// The slots and the network that slot `slot` belongs to, its number there, and the history.
    fn locate<'n>(&mut self, nets: Nets<'n>, slot: usize) -> Option<(&mut Slots, &'n FlowNet, usize, &History)> {
        let Self { history, reference, student, .. } = self;
        let before = reference.as_ref().map_or(0, Slots::count);
        match slot.checked_sub(before) {
            None => Some((reference.as_mut()?, nets.reference?, slot, history)),
            Some(slot) => Some((student.as_mut()?, nets.student()?, slot, history)),
        }
    }

    /// Computes a piece of slot `slot` anew from the history; returns the token to go on with, or
    /// `None` when the slot is through.
    pub fn rewrite(&mut self, tools: &mut Tools<'_>, slot: usize, stretch: Stretch) -> Option<u64> {
        let (slots, net, slot, history) = self.locate(tools.nets, slot)?;
        slots.rewrite(tools, net, history, slot, stretch)
    }

    /// Slots that `sampler` visits, in order; empty for one that is not supported.
    pub fn visits(&self, sampler: Sampler) -> impl Iterator<Item = usize> + '_ {
        let student = (sampler == Sampler::Single && self.student.is_some()).then(|| self.references());
        let reference = (sampler != Sampler::Single && self.supports(sampler)).then(|| self.schedule.visits(sampler));
        reference.into_iter().flatten().chain(student)
    }

    /// Finished tokens that slot `slot` lacks; 1 when it was used for the last token.
    pub fn behind(&self, slot: usize) -> u64 {
        let (slots, slot) = match slot.checked_sub(self.references()) {
            None => (&self.reference, slot),
            Some(slot) => (&self.student, slot),
        };
        slots.as_ref().map_or(0, |slots| slots.behind(slot, self.history.len()))
    }

    /// Whether slot `slot` has guidance branches.
    pub fn guides(&self, slot: usize) -> bool {
        let slots = self.reference.as_ref().filter(|slots| slot < slots.count());
        slots.is_some_and(|slots| slots.branches(slot) == Branches::Guided)
    }

    /// Brings the slot of `sampler` that is furthest behind nearer to the present by one pass.
    pub fn catch_up(&mut self, tools: &mut Tools<'_>, sampler: Sampler) {
        if let Some(slot) = self.visits(sampler).max_by_key(|slot| self.behind(*slot)) {
            self.catch_up_slot(tools, slot);
        }
    }

    /// One pass over slot `slot`, if it lacks anything: then it is true.
    fn catch_up_slot(&mut self, tools: &mut Tools<'_>, slot: usize) -> bool {
        let Some((slots, net, slot, history)) = self.locate(tools.nets, slot) else { return false };
        slots.catch_up(tools, net, history, slot)
    }

    /// Rows of one evaluation of `sampler` for the next token, with or without a gaze target;
    /// `None` where slots must catch up first or the sampler is not supported.
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
            (_, _, _, Some(a), Some(b)) => a.alike(b) && self.schedule == other.schedule,
            _ => false,
        }
    }

    /// Starts making the next token with `sampler` from its noise, which `noise` fills, given the
    /// token's index; [`super::sample`] makes it. A sampler that is not supported falls back to the
    /// midpoint rule, or without the reference network to a single step; sessions refuse such
    /// samplers before.
    pub fn begin(
        &mut self,
        sampler: Sampler,
        guidance: Guidance,
        condition: &Condition,
        noise: impl FnOnce(u64, &mut [f32]),
    ) {
        let token = self.history.len();
        noise(token, self.history.begin(condition));
        let other = if self.reference.is_some() { Sampler::Midpoint4 } else { Sampler::Single };
        let sampler = if self.supports(sampler) { sampler } else { other };
        let slots = (sampler != Sampler::Single).then(|| self.schedule.visits(sampler));
        self.making.begin(sampler, guidance, self.history.eps(token), slots.into_iter().flatten());
    }

    /// Evaluates the network of `sampler` once for the token that would be next and keeps nothing
    /// of it: what a step takes can be measured without making motion.
    pub fn rehearse(&mut self, tools: &mut Tools<'_>, sampler: Sampler, condition: &Condition) {
        self.history.begin(condition).fill(0.0);
        self.making.z.fill(0.0);
        let Self { history, reference, student, making, .. } = self;
        let slots = if sampler == Sampler::Single { student } else { reference };
        if let Some((slots, net)) = slots.as_mut().zip(tools.nets.of(sampler)) {
            slots.approach(tools, net, history, 0);
            tools.work.run_one(tools.exec, net, slots.evaluation(history, 0, &making.z));
            slots.forget_new(history);
        }
    }
}
