//! Activations that flow into named layers, for whoever measures what quantisation does to them.

use std::collections::BTreeMap;

/// Rows of each call that are kept, at most.
const ROWS: usize = 8;

/// Rows of inputs of named linear layers: the first rows of every `every`-th call, up to `limit` rows a layer.
///
/// Given to an [`Exec`](super::Exec) it listens to all its linear layers whose matrices have a name. It allocates: a tool, not part of
/// a running session.
#[derive(Debug, Clone, Default)]
pub struct Activations {
    limit: usize,
    every: usize,
    layers: BTreeMap<String, Layer>,
}

#[derive(Debug, Clone, Default)]
struct Layer {
    calls: usize,
    cols: usize,
    rows: Vec<f32>,
}

impl Activations {
    /// Keeps at most `limit` rows a layer, from every `every`-th call (1: from each).
    pub fn new(limit: usize, every: usize) -> Self {
        Self { limit, every: every.max(1), layers: BTreeMap::new() }
    }

    /// Names of the layers that were called, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layers.keys().map(String::as_str)
    }

    /// Inputs of layer `name`, rows one after the other; empty if it was never called.
    pub fn rows(&self, name: &str) -> &[f32] {
        self.layers.get(name).map_or(&[], |layer| &layer.rows)
    }

    pub(super) fn listen(&mut self, name: &str, x: &[f32], cols: usize) {
        if name.is_empty() {
            return;
        }
        if !self.layers.contains_key(name) {
            self.layers.insert(name.to_owned(), Layer { cols, ..Layer::default() });
        }
        let (limit, every) = (self.limit, self.every);
        if let Some(layer) = self.layers.get_mut(name) {
            layer.calls += 1;
            let kept = layer.rows.len() / layer.cols;
            if (layer.calls - 1) % every == 0 {
                let rows = ROWS.min(limit.saturating_sub(kept)) * layer.cols;
                layer.rows.extend_from_slice(&x[..rows.min(x.len())]);
            }
        }
    }
}
