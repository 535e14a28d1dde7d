//! Rows of activations: vectors that differ from row to row, and rows shared out over threads.

use crate::par::Pool;

/// Row r of a table of vectors is `table[index[r] * stride + offset ..][..dim]`.
///
/// One vector for all rows: `stride` 0 and any index. Modulation that depends on a row's flow time:
/// `index` is the flow time's number.
#[derive(Debug, Clone, Copy)]
pub struct RowTable<'a> {
    /// The vectors.
    pub table: &'a [f32],
    /// Values from one entry to the next.
    pub stride: usize,
    /// First value of the vector within an entry.
    pub offset: usize,
    /// Entry of each row.
    pub index: &'a [u32],
}

impl<'a> RowTable<'a> {
    /// Values `from .. from + len` of row `r`.
    pub(super) fn part(&self, r: usize, from: usize, len: usize) -> &'a [f32] {
        &self.table[self.index[r] as usize * self.stride + self.offset + from..][..len]
    }
}

/// A pointer into one slice that the pieces of one run hold; each writes a part of its own.
#[derive(Clone, Copy)]
pub(super) struct Disjoint<T = f32>(*mut T);
// SAFETY: pieces that hold it write disjoint ranges, which each use argues.
unsafe impl<T> Sync for Disjoint<T> {}

impl<T> Disjoint<T> {
    pub(super) fn new(slice: &mut [T]) -> Self {
        Self(slice.as_mut_ptr())
    }

    /// `len` values from `from`.
    ///
    /// # Safety
    /// The range lies in the slice that the pointer came from, and no other reference to it lives
    /// meanwhile.
    pub(super) unsafe fn part<'a>(&self, from: usize, len: usize) -> &'a mut [T] {
        // SAFETY: promised by the caller.
        unsafe { std::slice::from_raw_parts_mut(self.0.add(from), len) }
    }
}

/// Values of a few rows from which on sharing them out pays for telling the other thread.
const WORTH_SHARING: usize = 2048;

/// Calls `work` for each of `rows` rows, on both threads where `values`, the number of values in
/// all of them, makes it worth it.
pub(super) fn by_rows(pool: &mut Pool, rows: usize, values: usize, work: &(dyn Fn(usize) + Sync)) {
    if values < WORTH_SHARING {
        (0..rows).for_each(work);
    } else {
        pool.run(rows, &|row, _| work(row));
    }
}
