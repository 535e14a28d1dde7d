//! Attention of one query head of a group of rows, each over its span of one ring of the key and value cache.
//!
//! y = sum_t softmax_t(q . k_t / sqrt(head_dim)) v_t. Each dot product runs in 16 lanes; tokens go in chunks of
//! [`CHUNK`] with a running maximum and sum (Milakov and Gimelshein 2018, "Online normalizer calculation for softmax"),
//! so that no scratch grows with the span. An empty span gives zeros.

use half::f16;

use super::{Level, Variant};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod cache;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
mod group;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
mod sixteen;

pub(crate) use cache::Store;
pub use cache::{KvCache, KvDtype, Span};

/// Tokens between two updates of the running maximum.
pub(crate) const CHUNK: usize = 64;

/// Rows of one kernel call, at most: those of a decoder's block, one and its four tokens.
pub(crate) const MAX_GROUP: usize = 5;

/// Keys and values of one ring, seen by one head: `capacity` of `dim` values each.
#[derive(Clone, Copy)]
pub(crate) struct Head<'a, T> {
    pub(crate) k: &'a [T],
    pub(crate) v: &'a [T],
    pub(crate) dim: usize,
    pub(crate) capacity: usize,
}

/// One row of a group: its query and result, `dim` values each, and the tokens that it sees.
pub(crate) struct Row<'a> {
    pub(crate) q: &'a [f32],
    pub(crate) y: &'a mut [f32],
    /// Where the first token lies; the others follow, going on at 0 after the last.
    pub(crate) slot: usize,
    /// Tokens, at most `capacity`.
    pub(crate) len: usize,
    /// Tokens from the first that any row of the group sees to this row's first.
    pub(crate) shift: usize,
}

impl<T> Head<'_, T> {
    /// What every variant relies on.
    pub(crate) fn check(&self, rows: &[Row<'_>]) {
        assert!((1..=MAX_GROUP).contains(&rows.len()), "attend: a group of rows");
        for row in rows {
            assert!(row.q.len() == self.dim && row.y.len() == self.dim, "attend: q and y are one head each");
            assert!(
                row.len <= self.capacity && (row.len == 0 || row.slot < self.capacity),
                "attend: span fits the ring"
            );
        }
        let n = self.capacity * self.dim;
        assert!(self.dim > 0 && self.k.len() >= n && self.v.len() >= n, "attend: tokens exist");
    }

    /// Start of the head's values of the group's token `t`, which `row` sees.
    #[inline(always)]
    pub(crate) fn at(&self, row: &Row<'_>, t: usize) -> usize {
        let slot = row.slot + (t - row.shift);
        let slot = if slot >= self.capacity { slot - self.capacity } else { slot };
        slot * self.dim
    }
}

/// One variant: entries for both storages, unsafe to call on a CPU without its level.
pub(crate) struct Kernel {
    pub(crate) f16: unsafe fn(&Head<'_, f16>, &mut [Row<'_>]),
    pub(crate) f32: unsafe fn(&Head<'_, f32>, &mut [Row<'_>]),
}

pub(crate) static VARIANTS: &[Variant<Kernel>] = &[
    Variant { name: "scalar", level: Level::Scalar, run: Kernel { f16: scalar::f16, f32: scalar::f32 } },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx2", level: Level::Avx2, run: Kernel { f16: avx2::f16, f32: avx2::f32 } },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx512", level: Level::Avx512, run: Kernel { f16: avx512::f16, f32: avx512::f32 } },
    #[cfg(target_arch = "aarch64")]
    Variant { name: "neon", level: Level::Neon, run: Kernel { f16: neon::f16, f32: neon::f32 } },
];

#[cfg(test)]
mod tests;
