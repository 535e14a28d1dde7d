//! The key and value cache: rings of tokens, allocated once.

use crate::kernels::packed::{Buffer, Plain};
use half::f16;
use half::slice::HalfFloatSliceExt;

/// How keys and values are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KvDtype {
    /// Half floats: the default of a session.
    F16,
    /// Floats: the reference.
    F32,
}

/// Tokens `first .. first + len` of one ring: what one row attends to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// Which ring.
    pub ring: u32,
    /// Position of the first token; a token of position p lies at p modulo the ring's capacity.
    pub first: u64,
    /// Number of tokens, at most the ring's capacity; a row with none gets zeros.
    pub len: u32,
}

/// `rings` rings of `capacity` tokens, each a key and a value of `dim` values: `heads` equal parts.
///
/// A head's keys of all tokens of a ring lie one after the other, as do its values, so attention
/// reads streams. A ring keeps the last `capacity` positions written to it; whoever reads a span
/// knows that its tokens are still there.
pub struct KvCache {
    rings: usize,
    pub(crate) capacity: usize,
    heads: usize,
    dim: usize,
    pub(crate) store: Store,
}

/// Keys, then values.
pub(crate) enum Store {
    F16(Buffer, Buffer),
    F32(Buffer, Buffer),
}

impl KvCache {
    /// Allocates the cache, zeroed.
    ///
    /// # Panics
    /// When `capacity` or `dim` is 0, or `heads` does not divide `dim`.
    pub fn new(rings: usize, capacity: usize, heads: usize, dim: usize, dtype: KvDtype) -> Self {
        assert!(capacity > 0 && dim > 0, "a ring holds at least one token of at least one value");
        assert!(heads > 0 && dim.is_multiple_of(heads), "heads divide dim");
        let n = rings * capacity * dim;
        let store = match dtype {
            KvDtype::F16 => Store::F16(Buffer::new(2 * n), Buffer::new(2 * n)),
            KvDtype::F32 => Store::F32(Buffer::new(4 * n), Buffer::new(4 * n)),
        };
        Self { rings, capacity, heads, dim, store }
    }

    /// Writes the key and value of `position` into a ring; f16 storage rounds to nearest even.
    ///
    /// # Panics
    /// When the ring does not exist, or `k` or `v` are not `dim` long.
    pub fn write(&mut self, ring: usize, position: u64, k: &[f32], v: &[f32]) {
        assert!(k.len() == self.dim && v.len() == self.dim, "a token's key and value have dim values");
        let (n, token) = (self.head_dim(), self.index(position));
        for (head, (k, v)) in k.chunks_exact(n).zip(v.chunks_exact(n)).enumerate() {
            let at = self.offset(ring, head) + token * n;
            match &mut self.store {
                Store::F16(keys, values) => {
                    keys.of_mut::<f16>()[at..at + n].convert_from_f32_slice(k);
                    values.of_mut::<f16>()[at..at + n].convert_from_f32_slice(v);
                }
                Store::F32(keys, values) => {
                    keys.of_mut()[at..at + n].copy_from_slice(k);
                    values.of_mut()[at..at + n].copy_from_slice(v);
                }
            }
        }
    }

    /// Copies the token of `position` from one ring to another.
    ///
    /// # Panics
    /// When a ring does not exist.
    pub fn copy_token(&mut self, from_ring: usize, to_ring: usize, position: u64) {
        let (n, token) = (self.head_dim(), self.index(position));
        for head in 0..self.heads {
            self.copy(self.offset(from_ring, head) + token * n, self.offset(to_ring, head) + token * n, n);
        }
    }

    /// Copies all tokens from one ring to another.
    ///
    /// # Panics
    /// When a ring does not exist.
    pub fn copy_ring(&mut self, from_ring: usize, to_ring: usize) {
        self.copy(self.offset(from_ring, 0), self.offset(to_ring, 0), self.capacity * self.dim);
    }

    fn copy(&mut self, from: usize, to: usize, n: usize) {
        fn copy<T: Plain>(store: &mut Buffer, from: usize, to: usize, n: usize) {
            store.of_mut::<T>().copy_within(from..from + n, to);
        }
        match &mut self.store {
            Store::F16(keys, values) => [keys, values].map(|store| copy::<f16>(store, from, to, n)),
            Store::F32(keys, values) => [keys, values].map(|store| copy::<f32>(store, from, to, n)),
        };
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        match &self.store {
            Store::F16(k, v) | Store::F32(k, v) => k.bytes() + v.bytes(),
        }
    }

    /// Number of rings.
    pub fn rings(&self) -> usize {
        self.rings
    }

    /// Tokens of a ring.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Heads that share a key or a value.
    pub fn heads(&self) -> usize {
        self.heads
    }

    /// Values of a key or value: all heads'.
    pub fn dim(&self) -> usize {
        self.dim
    }

    pub(crate) fn head_dim(&self) -> usize {
        self.dim / self.heads
    }

    /// First value of a head in a ring; its tokens follow.
    pub(crate) fn offset(&self, ring: usize, head: usize) -> usize {
        assert!(ring < self.rings, "the cache has {} rings", self.rings);
        (ring * self.heads + head) * self.capacity * self.head_dim()
    }

    /// Which of its ring's tokens has `position`.
    pub(crate) fn index(&self, position: u64) -> usize {
        (position % self.capacity as u64) as usize
    }
}

impl std::fmt::Debug for KvCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "KvCache({} rings x {} tokens x {})", self.rings, self.capacity, self.dim)
    }
}
