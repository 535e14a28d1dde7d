//! Where the noise of tokens comes from.

use super::SessionOptions;
use crate::flow::normal;

/// Where the noise of tokens comes from.
#[derive(Debug)]
pub(super) enum Noise {
    /// From the session's seed.
    Seeded,
    /// Given values, `[tokens, latent]`; seeded beyond their end.
    Given(Vec<f32>),
}

impl Noise {
    /// Fills the noise of a token. What is seeded is scaled by the temperature; what is given
    /// enters as it is.
    pub(super) fn fill(&self, options: &SessionOptions, temperature: f32, token: u64, eps: &mut [f32]) {
        if let Noise::Given(values) = self
            && let Some(given) = values.chunks_exact(eps.len()).nth((token - options.diagnostics.first_block) as usize)
        {
            return eps.copy_from_slice(given);
        }
        normal(options.seed, token, eps);
        eps.iter_mut().for_each(|e| *e *= temperature);
    }
}
