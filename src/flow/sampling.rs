//! Sampling: one token, or those of several generators side by side, from noise to latents.

use super::generator::Generator;
use super::network::FlowNet;
use super::pass::{Part, Tools};
use super::slots::Slots;
use crate::frame::Sampler;

impl Generator {
    /// The slots of the network that makes the token.
    fn visited(&self) -> Option<&Slots> {
        if self.making.sampler == Sampler::Single { self.student.as_ref() } else { self.reference.as_ref() }
    }

    /// What the last evaluation predicted, `[3, latent]` of the reference network's branches (those
    /// that were not run are the last that was), `[latent]` of the student.
    pub fn x1(&self) -> &[f32] {
        let x1 = self.visited().map_or(&[][..], Slots::x1);
        if self.making.sampler == Sampler::Single { &x1[..x1.len().min(self.making.z.len())] } else { x1 }
    }

    /// Brings the slot of evaluation `i` near enough to the present for it.
    fn approach(&mut self, tools: &mut Tools<'_>, net: &FlowNet, i: usize) {
        let Self { history, reference, student, making, .. } = self;
        let slots = if making.sampler == Sampler::Single { student } else { reference };
        if let Some(slots) = slots {
            slots.approach(tools, net, history, usize::from(making.slots[i]));
        }
    }

    /// This generator's part in evaluation `i`.
    fn part(&mut self, i: usize) -> Option<Part<'_>> {
        let Self { history, reference, student, making, .. } = self;
        let slots = if making.sampler == Sampler::Single { student } else { reference };
        Some(slots.as_mut()?.evaluation(history, usize::from(making.slots[i]), &making.z))
    }

    /// Goes on with what evaluation `i` predicted.
    fn step(&mut self, i: usize) {
        let Self { reference, student, making, .. } = self;
        let slots = if making.sampler == Sampler::Single { student } else { reference };
        if let Some(slots) = slots {
            making.step(i, slots.x1());
        }
    }
}

/// Samples the begun tokens of all `members` that have a generator, and appends each to its
/// history; `seen` is called for each member after each of its evaluations ([`Generator::x1`]).
///
/// They have begun with one sampler. Several of them are alike for it ([`Generator::alike`]), and
/// their rows ([`Generator::rows`]) add up to [`super::SHARED_ROWS`] at most. What each makes is
/// what it makes by itself, bit for bit.
pub fn sample<M>(
    tools: &mut Tools<'_>,
    members: &mut [M],
    generator: impl for<'a> Fn(&'a mut M) -> Option<&'a mut Generator> + Copy,
    mut seen: impl FnMut(&mut M),
) {
    let Some(sampler) = members.iter_mut().find_map(generator).map(|generator| generator.making.sampler) else {
        return;
    };
    let Some(net) = tools.nets.of(sampler) else { return };
    for i in 0..sampler.evaluations() {
        for generator in members.iter_mut().filter_map(generator) {
            generator.approach(tools, net, i);
        }
        tools.work.run(tools.exec, net, members, |member| generator(member)?.part(i));
        for member in &mut *members {
            seen(member);
            generator(member).into_iter().for_each(|generator| generator.step(i));
        }
    }
    for generator in members.iter_mut().filter_map(generator) {
        generator.history.finish(&generator.making.z);
    }
}
