//! Passes that several generators share: their rows go through each layer together, which reads its weights once.
//!
//! A row's results depend on that row and its own cache alone, bit for bit, so what each generator makes is what it makes by itself.

use super::Condition;
use super::history::History;
use super::modulation::Modulation;
use super::network::FlowNet;
use super::sampler::{Generator, Guidance, Nets};
use super::slots::Slots;
use crate::frame::Sampler;
use crate::kernels::Exec;
use crate::nn::{Phases, Scratch};
use std::sync::Arc;

/// Rows that one pass takes: as many as a product of the kernels.
pub const SHARED_ROWS: usize = 16;

/// One generator's part in a pass: its slots, its history, and where its new token is.
pub(super) struct Part<'a> {
    pub(super) slots: &'a mut Slots,
    pub(super) history: &'a History,
    pub(super) z: &'a [f32],
}

/// Working memory of shared passes.
#[derive(Debug)]
pub struct SharedPass {
    scratch: Scratch,
    phases: Phases,
    index: Vec<u32>,
    x: Vec<f32>,
    rows: usize,
    modulation: Option<Arc<Modulation>>,
}

impl SharedPass {
    /// Memory for passes of `nets`, which are of one size.
    pub fn new(nets: Nets<'_>) -> Self {
        let net = nets.any();
        let c = net.config();
        Self {
            scratch: Scratch::new(SHARED_ROWS, c.width, c.width * c.mlp),
            phases: net.rope.phases(SHARED_ROWS),
            index: Vec::with_capacity(SHARED_ROWS),
            x: vec![0.0; SHARED_ROWS * c.width],
            rows: 0,
            modulation: None,
        }
    }

    /// Starts making the next token of `generator`; [`SharedPass::sample`] makes it.
    pub fn begin(
        generator: &mut Generator,
        sampler: Sampler,
        guidance: Guidance,
        condition: &Condition,
        noise: impl FnOnce(u64, &mut [f32]),
    ) {
        generator.begin(sampler, guidance, condition, noise);
    }

    /// Samples the begun tokens of `members` and appends each to its history, as [`Generator::sample`] does. They have begun with one sampler,
    /// for which they are [alike](Generator::alike), and their [rows](Generator::rows) add up to 16 at most; `generator` gets a member's.
    pub fn sample<M>(
        &mut self,
        exec: &mut Exec,
        nets: Nets<'_>,
        members: &mut [Option<M>],
        generator: impl for<'a> Fn(&'a mut M) -> &'a mut Generator + Copy,
    ) {
        let Some(first) = members.iter_mut().flatten().map(generator).next() else { return };
        let evaluations = first.evaluations();
        let Some(net) = nets.of(first.sampler()) else { return };
        for i in 0..evaluations {
            self.evaluate(exec, net, i, members, generator);
            members.iter_mut().flatten().map(generator).for_each(|generator| generator.step(i));
        }
        members.iter_mut().flatten().map(generator).for_each(|generator| {
            generator.finish();
        });
    }

    fn evaluate<M>(
        &mut self,
        exec: &mut Exec,
        net: &FlowNet,
        i: usize,
        members: &mut [Option<M>],
        generator: impl for<'a> Fn(&'a mut M) -> &'a mut Generator + Copy,
    ) {
        let (d, heads) = (net.config().width, net.config().heads);
        self.rows = 0;
        self.index.clear();
        for generator in members.iter_mut().flatten().map(generator) {
            let slot = generator.slot(i);
            let Some(Part { slots, history, z }) = generator.part() else { continue };
            let rows = slots.stage_next(exec, net, history, slot, z);
            slots.hand_over(rows, d, &mut self.x[self.rows * d..], &mut self.index);
            self.phases.copy_rows(self.rows, slots.phases(), rows, d / heads / 2);
            self.rows += rows;
            self.modulation.get_or_insert_with(|| slots.modulation());
        }
        let Some(modulation) = self.modulation.take() else { return };
        let Self { scratch, phases, index, x, rows, .. } = self;
        net.run(exec, &modulation, index, phases, *rows, scratch, x, &mut |exec, layer, qkv, out| {
            let mut from = 0;
            for generator in members.iter_mut().flatten().map(generator) {
                let (qkv, out) = (&qkv[from * 3 * d..], &mut out[from * d..]);
                from += generator.part().map_or(0, |part| part.slots.attend(exec, layer, qkv, out));
            }
        });
        let mut from = 0;
        for generator in members.iter_mut().flatten().map(generator) {
            let slot = generator.slot(i);
            let Some(Part { slots, history, .. }) = generator.part() else { continue };
            from += slots.take_back(exec, net, history, slot, &x[from * d..]);
        }
    }
}
