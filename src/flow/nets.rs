//! The networks that make latents, and what is done with what they say.

use super::network::FlowNet;
use crate::frame::Sampler;

/// Guidance weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guidance {
    /// Weight of the conditioning: `x = x_0 + weight (x_c - x_0)`; 1 is none, 1.3 the paper's.
    pub weight: f32,
    /// Weight of the gaze target: `+ gaze (x_g - x_c)`; 2 to 3 makes the dial obeyed.
    pub gaze: f32,
}

impl Guidance {
    /// The weights while what is heard calls for a reaction, by `share` 0 to 1, `further` being how
    /// many times as far guidance goes then: `weight - 1` grows to `further (weight - 1)`. So no
    /// guidance remains none, and with a share of 0 nothing changes, to the bit.
    #[must_use]
    pub fn reacting(self, share: f32, further: f32) -> Self {
        Self { weight: self.weight + share * (further - 1.0) * (self.weight - 1.0), ..self }
    }
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

    pub(super) fn student(self) -> Option<&'a FlowNet> {
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
