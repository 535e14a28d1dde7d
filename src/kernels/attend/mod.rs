//! Attention of one query head of a batch of rows, each over its span of one ring of the key and
//! value cache.
//!
//! y = sum_t softmax_t(q . k_t / sqrt(head_dim)) v_t. Each dot product runs in 16 lanes; tokens go
//! in chunks of [`CHUNK`] with a running maximum and sum (Milakov and Gimelshein 2018, "Online
//! normalizer calculation for softmax"), so that no scratch grows with the span. An empty span
//! gives zeros.

use half::f16;

use super::operation::operation;

mod batch;
mod cache;
mod scalar;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64", target_feature = "simd128"))]
mod simd;
#[cfg(test)]
mod tests;

pub(super) use batch::{MAX_SPANS, batches};
pub(crate) use cache::Store;
pub use cache::{KvCache, KvDtype, Span};

operation! {
    /// Attention of one head for the rows of a batch, at most [`MAX_BATCH`]; the head's keys and
    /// values, and the rows' queries, are what [`Head::check`] accepts.
    Attend = "attend", (fn(head: HeadOf<'_>, rows: &mut [Row<'_>]));
    (Scalar => scalar::run)
    (Neon, Avx2, Avx512, Simd128, Relaxed => simd::run, token)
}

/// Tokens between two updates of the running maximum.
pub(crate) const CHUNK: usize = 64;

/// Rows of one kernel call, at most: those of a decoder's block, one and its four tokens.
pub(crate) const MAX_BATCH: usize = 5;

/// A head's keys and values as the cache stores them.
#[derive(Clone, Copy)]
pub(crate) enum HeadOf<'a> {
    F16(Head<'a, f16>),
    F32(Head<'a, f32>),
}

/// Keys and values of one ring, seen by one head: `capacity` of `dim` values each.
#[derive(Clone, Copy)]
pub(crate) struct Head<'a, T> {
    pub(crate) k: &'a [T],
    pub(crate) v: &'a [T],
    pub(crate) dim: usize,
    pub(crate) capacity: usize,
}

/// One row of a batch: its query and result, `dim` values each, and the tokens that it sees.
pub(crate) struct Row<'a> {
    pub(crate) q: &'a [f32],
    pub(crate) y: &'a mut [f32],
    /// Which of the ring's tokens is the first; the others follow, going on at 0 after the last.
    pub(crate) first: usize,
    /// Tokens, at most `capacity`.
    pub(crate) len: usize,
    /// Tokens from the first that any row of the batch sees to this row's first.
    pub(crate) shift: usize,
}

impl<T> Head<'_, T> {
    /// What every variant relies on.
    pub(crate) fn check(&self, rows: &[Row<'_>]) {
        assert!((1..=MAX_BATCH).contains(&rows.len()), "attend: a batch of rows");
        for row in rows {
            assert!(row.q.len() == self.dim && row.y.len() == self.dim, "attend: q and y are one head each");
            assert!(
                row.len <= self.capacity && (row.len == 0 || row.first < self.capacity),
                "attend: span fits the ring"
            );
        }
        let n = self.capacity * self.dim;
        assert!(self.dim > 0 && self.k.len() >= n && self.v.len() >= n, "attend: tokens exist");
    }

    /// Start of the head's values of the batch's token `t`, which `row` sees.
    #[inline(always)]
    pub(crate) fn at(&self, row: &Row<'_>, t: usize) -> usize {
        let token = row.first + (t - row.shift);
        let token = if token >= self.capacity { token - self.capacity } else { token };
        token * self.dim
    }
}
