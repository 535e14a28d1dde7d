//! Which rows attend together: those whose spans lie in one ring, near each other.

use super::{MAX_BATCH, Span};

/// Spans that are put into batches at a time, without allocating.
pub(crate) const MAX_SPANS: usize = 64;

/// Spans of one batch begin at most this many tokens apart: what only some of its rows see is read
/// for each of them.
const MAX_SHIFT: u64 = 8;

/// Rows whose spans lie in one ring, near each other.
#[derive(Clone, Copy)]
pub(crate) struct Batch {
    rows: [u8; MAX_BATCH],
    len: usize,
}

impl Batch {
    /// Numbers of the spans; at least one.
    pub(crate) fn rows(&self) -> &[u8] {
        &self.rows[..self.len]
    }
}

/// Batches that hold each of at most [`MAX_SPANS`] spans once, and their number.
pub(crate) fn batches(spans: &[Span]) -> ([Batch; MAX_SPANS], usize) {
    let mut batches = [Batch { rows: [0; MAX_BATCH], len: 0 }; MAX_SPANS];
    let mut n = 0;
    for (i, span) in spans.iter().enumerate() {
        let near = |batch: &Batch| {
            let mut others = batch.rows().iter().map(|&j| &spans[usize::from(j)]);
            batch.len < MAX_BATCH
                && others.all(|other| other.ring == span.ring && other.first.abs_diff(span.first) <= MAX_SHIFT)
        };
        let at = batches[..n].iter().position(near).unwrap_or(n);
        n = n.max(at + 1);
        let batch = &mut batches[at];
        batch.rows[batch.len] = i as u8;
        batch.len += 1;
    }
    (batches, n)
}
