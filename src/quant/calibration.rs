//! Second moments of what flows into each layer, of a reference run over a conversation.

use super::nearest_plane::factor;
use super::scene::Scene;
use super::teacher::Teacher;
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::Sampler;
use crate::kernels::Activations;
use std::sync::Arc;

/// Of the calls of a layer within blocks of eight evaluations, which ones count.
const EVERY: usize = 5;

/// Statistics of the inputs of all layers.
#[derive(Debug)]
pub struct Calibration(Activations);

impl Calibration {
    /// Runs `reference` over `scene`, with its own sampler and with the single step where it has a
    /// student.
    ///
    /// # Errors
    /// None that loading the bundle would not have met.
    pub fn new(reference: &Arc<Engine>, scene: &Scene) -> Result<Self> {
        let mut activations = Some(Activations::moments_of(EVERY));
        Teacher::new(reference, scene.clone(), Sampler::Midpoint4, 0, &mut activations)?;
        if reference.config().student.is_some() {
            // One call per block: each counts. The other networks' inputs are the same kind again.
            if let Some(a) = &mut activations {
                a.set_every(1);
            }
            Teacher::new(reference, scene.clone(), Sampler::Single, 0, &mut activations)?;
        }
        Ok(Self(activations.unwrap_or_default()))
    }

    /// The triangular factor that rounding layer `name` of `cols` inputs needs; `None` for a layer
    /// that nothing ran through.
    pub(super) fn factor(&self, name: &str, cols: usize) -> Option<Vec<f32>> {
        let moments = self.0.moments(name);
        if moments.len() == cols * cols { factor(moments, cols) } else { None }
    }
}
