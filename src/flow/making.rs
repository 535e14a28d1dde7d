//! Integration of the flow from noise to a latent: the rules of the samplers.

use super::nets::Guidance;
use super::schedule::FlowTime;
use super::slots::{GAZE, NO_GAZE, UNCONDITIONAL};
use crate::frame::{EulerSteps, Sampler};

/// The token that a generator makes.
#[derive(Debug)]
pub(super) struct Making {
    pub(super) sampler: Sampler,
    guidance: Guidance,
    /// Slot of each evaluation, within its network's.
    pub(super) slots: [u8; EulerSteps::MAX as usize],
    /// The token at the flow time that has been reached.
    pub(super) z: Vec<f32>,
    /// Where the present step began.
    start: Vec<f32>,
    /// Where the guided flow leads to.
    x1: Vec<f32>,
}

impl Making {
    pub(super) fn new(latent: usize) -> Self {
        Self {
            sampler: Sampler::Midpoint4,
            guidance: Guidance { weight: 1.0, gaze: 0.0 },
            slots: [0; EulerSteps::MAX as usize],
            z: vec![0.0; latent],
            start: vec![0.0; latent],
            x1: vec![0.0; latent],
        }
    }

    /// A token from its noise; `slots` are those of the evaluations, none of a single step, which
    /// has slot 0.
    pub(super) fn begin(
        &mut self,
        sampler: Sampler,
        guidance: Guidance,
        noise: &[f32],
        slots: impl Iterator<Item = usize>,
    ) {
        (self.sampler, self.guidance) = (sampler, guidance);
        self.z.copy_from_slice(noise);
        self.slots.fill(0);
        // At most 8 and 64 slots.
        self.slots.iter_mut().zip(slots).for_each(|(number, slot)| *number = slot as u8);
    }

    /// Goes on with what evaluation `i` predicted: `x1` of each branch.
    ///
    /// Midpoint: `z_mid = z + h/2 v(z, tau)`, `z += h v(z_mid, tau + h/2)` with `h = 1 / steps`;
    /// the last step goes on from `z_mid` by another `h/2` instead and ends at the last `x1`.
    /// By the rule it would end at twice that less the `x1` before: errors of both, as fidgeting.
    /// Euler: `z += v(z, tau) / steps`.
    pub(super) fn step(&mut self, i: usize, x1: &[f32]) {
        if self.sampler == Sampler::Single {
            return self.z.copy_from_slice(&x1[..self.x1.len()]);
        }
        let g = self.guidance;
        let latent = self.x1.len();
        let branch = |b: usize| &x1[b * latent..][..latent];
        let (x0, xc, xg) = (branch(UNCONDITIONAL), branch(NO_GAZE), branch(GAZE));
        for (((x, x0), xc), xg) in self.x1.iter_mut().zip(x0).zip(xc).zip(xg) {
            *x = x0 + g.weight * (xc - x0) + g.gaze * (xg - xc);
        }
        let (tau, h) = (FlowTime::of(self.sampler, i).value(), 1.0 / f32::from(self.sampler.steps()));
        let midpoint = self.sampler.is_midpoint();
        let half = midpoint && (i.is_multiple_of(2) || i + 1 == self.sampler.evaluations());
        if !midpoint || half {
            self.start.copy_from_slice(&self.z);
        }
        advance(&mut self.z, &self.start, &self.x1, if half { 0.5 * h } else { h }, tau);
    }
}

/// `z = start + h v` with the velocity `v = (x1 - z) / (1 - tau)` at `z`, where the network was
/// evaluated.
fn advance(z: &mut [f32], start: &[f32], x1: &[f32], h: f32, tau: f32) {
    let k = h / (1.0 - tau);
    for ((z, start), x1) in z.iter_mut().zip(start).zip(x1) {
        *z = start + k * (x1 - *z);
    }
}
