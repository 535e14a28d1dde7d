//! Projected conditioning of the last tokens: the same for every slot of a network, so it is
//! computed once per token.

/// What is projected of a token: its unconditional input, that without a guided gaze target, and
/// that with it.
pub(super) const INPUTS: usize = 3;

/// A ring of tokens, `[token % capacity][INPUTS][width]`.
#[derive(Debug)]
pub(super) struct Projected {
    values: Vec<f32>,
    width: usize,
    capacity: u64,
    /// Tokens before this are there, the last `capacity` of them.
    end: u64,
}

impl Projected {
    /// Room for the last `capacity` tokens.
    pub(super) fn new(capacity: u64, width: usize) -> Self {
        Self { values: vec![0.0; capacity as usize * INPUTS * width], width, capacity, end: 0 }
    }

    /// Forgets all tokens; the next one has the index `next`.
    pub(super) fn forget(&mut self, next: u64) {
        self.end = next;
    }

    /// Forgets tokens from `token` on.
    pub(super) fn forget_from(&mut self, token: u64) {
        self.end = self.end.min(token);
    }

    /// Where `token` is to be projected to, `[INPUTS, width]`, unless it has been; tokens come in order.
    pub(super) fn missing(&mut self, token: u64) -> Option<&mut [f32]> {
        if token < self.end && token + self.capacity > self.end {
            return None;
        }
        self.end = token + 1;
        let at = self.at(token);
        Some(&mut self.values[at..][..INPUTS * self.width])
    }

    /// The vectors of `token`.
    pub(super) fn of(&self, token: u64) -> [&[f32]; INPUTS] {
        std::array::from_fn(|i| &self.values[self.at(token) + i * self.width..][..self.width])
    }

    fn at(&self, token: u64) -> usize {
        (token % self.capacity) as usize * INPUTS * self.width
    }
}
