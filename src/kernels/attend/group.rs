//! One head for a group of rows, for every level: a token's key and value are read and widened once for all rows that see it.
//!
//! Each row has the sums of [`scalar`] in their order: chunks of its own tokens, and tokens of a chunk one after the other. Rows go
//! through their chunks in step; what of a chunk not all of them see, they see one by one.

use std::ops::Range;

use super::scalar::{self, fold_chunk, soften};
use super::sixteen::{Sixteen, Stored};
use super::{CHUNK, Head, MAX_GROUP, Row};

/// Tokens ahead of the one in work whose keys are asked for.
const AHEAD: usize = 8;

/// # Safety
/// As [`Sixteen`].
#[inline(always)]
pub(super) unsafe fn attend<L: Sixteen, T: Stored>(head: &Head<'_, T>, rows: &mut [Row<'_>]) {
    head.check(rows);
    if !head.dim.is_multiple_of(16) {
        for row in rows {
            scalar::row(head, row, T::to_f32);
        }
        return;
    }
    let (mut top, mut total) = ([f32::NEG_INFINITY; MAX_GROUP], [0.0f32; MAX_GROUP]);
    let longest = rows.iter().map(|r| r.len).max().unwrap_or(0);
    rows.iter_mut().for_each(|r| r.y.fill(0.0));
    for start in (0..longest).step_by(CHUNK) {
        let mut p = [[0.0f32; CHUNK]; MAX_GROUP];
        let chunk = Chunk::new(rows, start);
        // SAFETY: promised by the caller.
        unsafe { chunk.each::<L, T, Scores>(head, rows, &mut p) };
        for (r, row) in rows.iter_mut().enumerate() {
            let tokens = chunk.tokens[r].len();
            if tokens > 0 {
                let scale = 1.0 / (head.dim as f32).sqrt();
                p[r].iter_mut().for_each(|p| *p *= scale);
                let (keep, new_top) = soften(&mut p[r], tokens, top[r]);
                total[r] = total[r].mul_add(keep, fold_chunk(&p[r]));
                top[r] = new_top;
                if start > 0 {
                    row.y.iter_mut().for_each(|y| *y *= keep);
                }
            }
        }
        // SAFETY: promised by the caller.
        unsafe { chunk.each::<L, T, Mix>(head, rows, &mut p) };
    }
    for (row, total) in rows.iter_mut().zip(total) {
        if row.len > 0 {
            let inverse = 1.0 / total;
            row.y.iter_mut().for_each(|y| *y *= inverse);
        }
    }
}

/// Weights of the tokens of one chunk, for each row.
type Weights = [[f32; CHUNK]; MAX_GROUP];

/// Chunks of the same number, one of each row; tokens count from the first that any row of the group sees.
struct Chunk {
    tokens: [Range<usize>; MAX_GROUP],
    /// Tokens of all of them.
    common: Range<usize>,
}

impl Chunk {
    /// Each row's chunk that begins `start` tokens into what it sees.
    #[inline(always)]
    fn new(rows: &[Row<'_>], start: usize) -> Self {
        let mut tokens = [const { 0..0 }; MAX_GROUP];
        let mut common = 0..usize::MAX;
        for (row, tokens) in rows.iter().zip(&mut tokens) {
            *tokens = row.shift + start.min(row.len)..row.shift + (start + CHUNK).min(row.len);
            common = common.start.max(tokens.start)..common.end.min(tokens.end);
        }
        Self { tokens, common }
    }

    /// Has `S` work through all tokens of all rows, ascending for each row.
    ///
    /// # Safety
    /// As [`Sixteen`].
    #[inline(always)]
    unsafe fn each<L: Sixteen, T: Stored, S: Step>(&self, head: &Head<'_, T>, rows: &mut [Row<'_>], p: &mut Weights) {
        let n = rows.len();
        if n == 1 || self.common.is_empty() {
            for r in 0..n {
                // SAFETY: promised by the caller.
                unsafe { self.alone::<L, T, S>(head, rows, p, r, self.tokens[r].clone()) };
            }
            return;
        }
        for r in 0..n {
            // SAFETY: promised by the caller; `common` begins in every chunk.
            unsafe { self.alone::<L, T, S>(head, rows, p, r, self.tokens[r].start..self.common.start) };
        }
        let (all, tokens) = (&self.tokens[..n], self.common.clone());
        // SAFETY: promised by the caller; `common` is within every chunk.
        unsafe {
            match n {
                2 => S::run::<L, T, 2>(head, rows, p, all, tokens),
                3 => S::run::<L, T, 3>(head, rows, p, all, tokens),
                4 => S::run::<L, T, 4>(head, rows, p, all, tokens),
                5 => S::run::<L, T, MAX_GROUP>(head, rows, p, all, tokens),
                _ => unreachable!("groups were checked"),
            }
        }
        for r in 0..n {
            // SAFETY: promised by the caller; `common` ends in every chunk.
            unsafe { self.alone::<L, T, S>(head, rows, p, r, self.common.end..self.tokens[r].end) };
        }
    }

    /// Has `S` work through `tokens` of the chunk of row `r`.
    ///
    /// # Safety
    /// As [`Sixteen`]; `tokens` are the chunk's.
    #[inline(always)]
    unsafe fn alone<L: Sixteen, T: Stored, S: Step>(
        &self,
        head: &Head<'_, T>,
        rows: &mut [Row<'_>],
        p: &mut Weights,
        r: usize,
        tokens: Range<usize>,
    ) {
        if !tokens.is_empty() {
            let (row, p) = (&mut rows[r..=r], &mut p[r..=r]);
            // SAFETY: promised by the caller.
            unsafe { S::run::<L, T, 1>(head, row, p, &self.tokens[r..=r], tokens) };
        }
    }
}

/// One pass over tokens that R rows see.
trait Step {
    /// # Safety
    /// As [`Sixteen`]; `rows`, `p` and `chunks` are R, and `tokens` lie in each chunk.
    unsafe fn run<L: Sixteen, T: Stored, const R: usize>(
        head: &Head<'_, T>,
        rows: &mut [Row<'_>],
        p: &mut [[f32; CHUNK]],
        chunks: &[Range<usize>],
        tokens: Range<usize>,
    );
}

/// p = q . k
struct Scores;

impl Step for Scores {
    #[inline(always)]
    unsafe fn run<L: Sixteen, T: Stored, const R: usize>(
        head: &Head<'_, T>,
        rows: &mut [Row<'_>],
        p: &mut [[f32; CHUNK]],
        chunks: &[Range<usize>],
        tokens: Range<usize>,
    ) {
        let mut t = tokens.start;
        while t < tokens.end {
            // SAFETY: promised by the caller; tokens t .. t + n are `tokens`.
            let n = unsafe {
                match tokens.end - t {
                    4.. if L::ROOM >= 4 * R => scores::<L, T, R, 4>(head, rows, p, chunks, t),
                    2.. if L::ROOM >= 2 * R => scores::<L, T, R, 2>(head, rows, p, chunks, t),
                    _ => scores::<L, T, R, 1>(head, rows, p, chunks, t),
                }
            };
            for t in t..t + n {
                // Values are wanted right after the scores.
                let (value, key) = (head.at(&rows[0], t), t + AHEAD);
                // SAFETY: as above.
                unsafe { fetch::<L, T>(&head.v[value..][..head.dim]) };
                if key < tokens.end {
                    // SAFETY: as above.
                    unsafe { fetch::<L, T>(&head.k[head.at(&rows[0], key)..][..head.dim]) };
                }
            }
            t += n;
        }
    }
}

/// # Safety
/// As [`Sixteen`].
#[inline(always)]
unsafe fn fetch<L: Sixteen, T>(row: &[T]) {
    for line in (0..size_of_val(row)).step_by(64) {
        // SAFETY: promised by the caller.
        unsafe { L::fetch(row.as_ptr().cast::<u8>().wrapping_add(line)) };
    }
}

/// Dot products of the rows' queries with the keys of tokens `t .. t + N`; returns N.
///
/// # Safety
/// As [`Step::run`].
#[inline(always)]
unsafe fn scores<L: Sixteen, T: Stored, const R: usize, const N: usize>(
    head: &Head<'_, T>,
    rows: &[Row<'_>],
    p: &mut [[f32; CHUNK]],
    chunks: &[Range<usize>],
    t: usize,
) -> usize {
    let mut keys = [head.k; N];
    for (i, key) in keys.iter_mut().enumerate() {
        *key = &head.k[head.at(&rows[0], t + i)..][..head.dim];
    }
    // SAFETY: promised by the caller.
    let mut acc = [[unsafe { L::zero() }; N]; R];
    for j in (0..head.dim).step_by(16) {
        // SAFETY: promised by the caller; 16 values from j, below the length of keys and queries, which is a multiple of 16.
        unsafe {
            let mut k = [L::zero(); N];
            for i in 0..N {
                k[i] = T::load(keys[i].as_ptr().add(j));
            }
            for r in 0..R {
                let q = L::load(rows[r].q.as_ptr().add(j));
                for i in 0..N {
                    acc[r][i] = acc[r][i].fma(q, k[i]);
                }
            }
        }
    }
    for r in 0..R {
        for i in 0..N {
            // SAFETY: promised by the caller.
            p[r][t + i - chunks[r].start] = unsafe { acc[r][i].fold() };
        }
    }
    N
}

/// y += p v
struct Mix;

impl Step for Mix {
    #[inline(always)]
    unsafe fn run<L: Sixteen, T: Stored, const R: usize>(
        head: &Head<'_, T>,
        rows: &mut [Row<'_>],
        p: &mut [[f32; CHUNK]],
        chunks: &[Range<usize>],
        tokens: Range<usize>,
    ) {
        let mut column = 0;
        while column < head.dim {
            let tokens = tokens.clone();
            // Few accumulators would wait for each other's sums.
            // SAFETY: promised by the caller; columns from `column`, 16 times as many as the match says, are the head's.
            column += unsafe {
                match (head.dim - column) / 16 {
                    8.. if L::ROOM >= 8 * R => mix::<L, T, R, 8>(head, rows, p, chunks, tokens, column),
                    4.. if L::ROOM >= 4 * R => mix::<L, T, R, 4>(head, rows, p, chunks, tokens, column),
                    2.. if L::ROOM >= 2 * R => mix::<L, T, R, 2>(head, rows, p, chunks, tokens, column),
                    _ => mix::<L, T, R, 1>(head, rows, p, chunks, tokens, column),
                }
            };
        }
    }
}

/// Adds the weighted values of `tokens` to 16 N columns of the rows' results; returns their number.
///
/// # Safety
/// As [`Step::run`].
#[inline(always)]
unsafe fn mix<L: Sixteen, T: Stored, const R: usize, const N: usize>(
    head: &Head<'_, T>,
    rows: &mut [Row<'_>],
    p: &[[f32; CHUNK]],
    chunks: &[Range<usize>],
    tokens: Range<usize>,
    column: usize,
) -> usize {
    // SAFETY: promised by the caller.
    let mut acc = [[unsafe { L::zero() }; N]; R];
    for r in 0..R {
        let y = &rows[r].y[column..][..16 * N];
        for i in 0..N {
            // SAFETY: promised by the caller; 16 N values at `y`.
            acc[r][i] = unsafe { L::load(y.as_ptr().add(16 * i)) };
        }
    }
    for t in tokens {
        let values = &head.v[head.at(&rows[0], t) + column..][..16 * N];
        // SAFETY: promised by the caller; 16 N values at `values`.
        unsafe {
            let mut weights = [L::zero(); R];
            for r in 0..R {
                weights[r] = L::splat(p[r][t - chunks[r].start]);
            }
            for i in 0..N {
                let v = T::load(values.as_ptr().add(16 * i));
                for r in 0..R {
                    acc[r][i] = acc[r][i].fma(weights[r], v);
                }
            }
        }
    }
    for r in 0..R {
        let y = &mut rows[r].y[column..][..16 * N];
        for i in 0..N {
            // SAFETY: as above.
            unsafe { acc[r][i].store(y.as_mut_ptr().add(16 * i)) };
        }
    }
    16 * N
}
