//! Attention of one query head over a span of one ring of the key and value cache.
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
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;

pub(crate) use cache::Store;
pub use cache::{KvCache, KvDtype, Span};

/// Tokens between two updates of the running maximum.
pub(crate) const CHUNK: usize = 64;

/// Keys and values of one ring, seen by one head.
#[derive(Clone, Copy)]
pub(crate) struct Head<'a, T> {
    /// `capacity` rows of `dim` values.
    pub(crate) k: &'a [T],
    pub(crate) v: &'a [T],
    pub(crate) dim: usize,
    pub(crate) capacity: usize,
    /// Row of the first token; the others follow, going on at row 0 after the last.
    pub(crate) slot: usize,
    /// Tokens, at most `capacity`.
    pub(crate) len: usize,
}

impl<T> Head<'_, T> {
    /// What every variant relies on.
    pub(crate) fn check(&self, q: &[f32], out: &[f32]) {
        assert!(!q.is_empty() && q.len() == out.len(), "attend: q and y are one head each");
        assert!(
            self.len <= self.capacity && (self.len == 0 || self.slot < self.capacity),
            "attend: span fits the ring"
        );
        assert!(q.len() == self.dim, "attend: a query for this head");
        let n = self.capacity * self.dim;
        assert!(self.k.len() >= n && self.v.len() >= n, "attend: rows exist");
    }

    /// Start of the head's values of token `t`.
    #[inline(always)]
    pub(crate) fn at(&self, t: usize) -> usize {
        let slot = self.slot + t;
        let slot = if slot >= self.capacity { slot - self.capacity } else { slot };
        slot * self.dim
    }
}

/// One variant: entries for both storages, unsafe to call on a CPU without its level.
pub(crate) struct Kernel {
    pub(crate) f16: unsafe fn(&Head<'_, f16>, q: &[f32], out: &mut [f32]),
    pub(crate) f32: unsafe fn(&Head<'_, f32>, q: &[f32], out: &mut [f32]),
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
