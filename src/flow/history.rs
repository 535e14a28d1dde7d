//! The last tokens of a session: latent, noise and conditioning. Shared by the reference network
//! and the student.

use super::{Condition, ConditionLayout};

/// A ring of tokens. Token `len()` is the one being made: its noise and conditioning are set by
/// [`History::begin`], its latent by [`History::finish`].
#[derive(Debug)]
pub struct History {
    capacity: usize,
    latent: usize,
    first: u64,
    len: u64,
    z: Vec<f32>,
    eps: Vec<f32>,
    conditions: Vec<Condition>,
}

impl History {
    /// Room for the last `capacity` tokens of `latent` channels.
    pub fn new(capacity: usize, latent: usize, layout: ConditionLayout) -> Self {
        Self {
            capacity,
            latent,
            first: 0,
            len: 0,
            z: vec![0.0; capacity * latent],
            eps: vec![0.0; capacity * latent],
            conditions: vec![Condition::absent(layout); capacity],
        }
    }

    /// Forgets all tokens; the next one gets the index `first`.
    pub fn reset(&mut self, first: u64) {
        (self.first, self.len) = (first, first);
    }

    /// Index of the token being made: that of the first token and the number of finished ones.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether no token is finished yet.
    pub fn is_empty(&self) -> bool {
        self.len == self.first
    }

    /// Sets the conditioning of the token being made and hands out its noise to be filled.
    pub fn begin(&mut self, condition: &Condition) -> &mut [f32] {
        let at = self.at(self.len);
        self.conditions[at].copy_from(condition);
        &mut self.eps[at * self.latent..][..self.latent]
    }

    /// Sets the latent of the token being made, which is finished by this.
    pub fn finish(&mut self, z: &[f32]) {
        let at = self.at(self.len);
        self.z[at * self.latent..][..self.latent].copy_from_slice(z);
        self.len += 1;
    }

    /// Replaces the latent of a finished token (re-anchoring).
    pub fn replace(&mut self, token: u64, z: &[f32]) {
        let at = self.at(token);
        self.z[at * self.latent..][..self.latent].copy_from_slice(z);
    }

    /// Standardised latent of a finished token.
    pub fn z(&self, token: u64) -> &[f32] {
        &self.z[self.at(token) * self.latent..][..self.latent]
    }

    /// Noise of a token.
    pub fn eps(&self, token: u64) -> &[f32] {
        &self.eps[self.at(token) * self.latent..][..self.latent]
    }

    /// Conditioning of a token.
    pub fn condition(&self, token: u64) -> &Condition {
        &self.conditions[self.at(token)]
    }

    fn at(&self, token: u64) -> usize {
        debug_assert!(token <= self.len && token + self.capacity as u64 > self.len);
        (token % self.capacity as u64) as usize
    }
}
