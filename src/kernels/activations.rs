//! Activations that flow into named layers, for whoever measures what quantisation does to them.

use std::collections::BTreeMap;

/// Calls of a layer of which all count for second moments: what turns flow times into modulation
/// runs a few times at the start.
const FIRST: usize = 64;

/// Rows of each call that are kept, at most.
const ROWS: usize = 8;

/// What flows into named linear layers in every `every`-th call: up to `limit` rows of each, or the
/// second moments of all.
///
/// Given to an [`Exec`](super::Exec) it listens to all its linear layers whose matrices have a
/// name. It allocates: a tool, not part of a running session.
#[derive(Debug, Clone, Default)]
pub struct Activations {
    limit: usize,
    every: usize,
    moments: bool,
    layers: BTreeMap<String, Layer>,
}

#[derive(Debug, Clone, Default)]
struct Layer {
    calls: usize,
    cols: usize,
    rows: Vec<f32>,
    /// Upper triangle of the sum of x x'.
    moments: Vec<f64>,
}

#[cfg(feature = "internals")]
impl Activations {
    /// Keeps at most `limit` rows per layer, from every `every`-th call (1: from each).
    pub fn new(limit: usize, every: usize) -> Self {
        Self { limit, every: every.max(1), moments: false, layers: BTreeMap::new() }
    }

    /// Sums up second moments instead of keeping rows; the first 64 calls of a layer count too.
    pub fn moments_of(every: usize) -> Self {
        Self { limit: 0, every: every.max(1), moments: true, layers: BTreeMap::new() }
    }

    /// From here on every `every`-th call of each layer counts.
    pub fn set_every(&mut self, every: usize) {
        self.every = every.max(1);
    }

    /// Sums of the products of inputs i and j of layer `name`, `[inputs, inputs]` of which the
    /// upper triangle counts; empty if it was never called or rows were kept instead.
    pub fn moments(&self, name: &str) -> &[f64] {
        self.layers.get(name).map_or(&[], |layer| &layer.moments)
    }

    /// Names of the layers that were called, in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layers.keys().map(String::as_str)
    }

    /// Inputs of layer `name`, rows one after the other; empty if it was never called.
    pub fn rows(&self, name: &str) -> &[f32] {
        self.layers.get(name).map_or(&[], |layer| &layer.rows)
    }
}

impl Activations {
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
            let counts = (layer.calls - 1).is_multiple_of(every);
            if self.moments {
                if counts || layer.calls <= FIRST {
                    layer.add(x);
                }
                return;
            }
            if !counts {
                return;
            }
            let rows = ROWS.min(limit.saturating_sub(layer.rows.len() / cols)) * cols;
            layer.rows.extend_from_slice(&x[..rows.min(x.len())]);
        }
    }
}

impl Layer {
    fn add(&mut self, x: &[f32]) {
        let n = self.cols;
        self.moments.resize(n * n, 0.0);
        for row in x.chunks_exact(n) {
            for (i, &v) in row.iter().enumerate().filter(|(_, v)| **v != 0.0) {
                let sums = &mut self.moments[i * n + i..][..n - i];
                sums.iter_mut().zip(&row[i..]).for_each(|(s, w)| *s += f64::from(v) * f64::from(*w));
            }
        }
    }
}
