//! One head for a batch of rows, on any level with [`F32x16`]: a token's key and value are read and
//! widened once for all rows that see it.
//!
//! Each row has the sums of [`scalar`] in their order: chunks of its own tokens, and tokens of a
//! chunk one after the other. Rows go through their chunks in step; what of a chunk not all of them
//! see, they see one by one.

use std::ops::Range;

use super::scalar::{self, fold_chunk, online_softmax};
use super::{CHUNK, Head, HeadOf, MAX_BATCH, Row};
use crate::kernels::f32x16::{F32x16, Stored};

/// Tokens ahead of the one in work whose keys are asked for.
const AHEAD: usize = 8;

#[inline(always)]
pub(super) fn run<L: F32x16>(level: L, head: HeadOf<'_>, rows: &mut [Row<'_>]) {
    match head {
        HeadOf::F16(head) => attend(level, &head, rows),
        HeadOf::F32(head) => attend(level, &head, rows),
    }
}

#[inline(always)]
fn attend<L: F32x16, T: Stored>(level: L, head: &Head<'_, T>, rows: &mut [Row<'_>]) {
    head.check(rows);
    if !head.dim.is_multiple_of(16) {
        rows.iter_mut().for_each(|r| scalar::row(head, r));
        return;
    }
    let (mut top, mut total) = ([f32::NEG_INFINITY; MAX_BATCH], [0.0f32; MAX_BATCH]);
    let longest = rows.iter().map(|r| r.len).max().unwrap_or(0);
    rows.iter_mut().for_each(|r| r.y.fill(0.0));
    for start in (0..longest).step_by(CHUNK) {
        let mut p = [[0.0f32; CHUNK]; MAX_BATCH];
        let chunk = Chunk::new(rows, start);
        chunk.each::<L, T, Scores>(level, head, rows, &mut p);
        for (r, row) in rows.iter_mut().enumerate() {
            let tokens = chunk.tokens[r].len();
            if tokens > 0 {
                let scale = 1.0 / (head.dim as f32).sqrt();
                p[r].iter_mut().for_each(|p| *p *= scale);
                let (keep, new_top) = online_softmax(&mut p[r], tokens, top[r], |p, top| level.exp(p, top));
                total[r] = total[r].mul_add(keep, fold_chunk(&p[r]));
                top[r] = new_top;
                if start > 0 {
                    row.y.iter_mut().for_each(|y| *y *= keep);
                }
            }
        }
        chunk.each::<L, T, Mix>(level, head, rows, &mut p);
    }
    for (row, total) in rows.iter_mut().zip(total) {
        if row.len > 0 {
            let inverse = 1.0 / total;
            row.y.iter_mut().for_each(|y| *y *= inverse);
        }
    }
}

/// Weights of the tokens of one chunk, per row.
type Weights = [[f32; CHUNK]; MAX_BATCH];

/// Chunks of the same number, one per row; tokens count from the first that any row of the batch
/// sees.
struct Chunk {
    tokens: [Range<usize>; MAX_BATCH],
    /// Tokens of all of them.
    common: Range<usize>,
}

impl Chunk {
    /// Each row's chunk that begins `start` tokens into what it sees.
    #[inline(always)]
    fn new(rows: &[Row<'_>], start: usize) -> Self {
        let mut tokens = [const { 0..0 }; MAX_BATCH];
        let mut common = 0..usize::MAX;
        for (row, tokens) in rows.iter().zip(&mut tokens) {
            *tokens = row.shift + start.min(row.len)..row.shift + (start + CHUNK).min(row.len);
            common = common.start.max(tokens.start)..common.end.min(tokens.end);
        }
        Self { tokens, common }
    }

    /// Has `S` work through all tokens of all rows, ascending for each row.
    #[inline(always)]
    fn each<L: F32x16, T: Stored, S: Step>(&self, level: L, head: &Head<'_, T>, rows: &mut [Row<'_>], p: &mut Weights) {
        let n = rows.len();
        if n == 1 || self.common.is_empty() {
            for r in 0..n {
                self.alone::<L, T, S>(level, head, rows, p, r, self.tokens[r].clone());
            }
            return;
        }
        for r in 0..n {
            self.alone::<L, T, S>(level, head, rows, p, r, self.tokens[r].start..self.common.start);
        }
        let (all, tokens) = (&self.tokens[..n], self.common.clone());
        match n {
            2 => S::run::<L, T, 2>(level, head, rows, p, all, tokens),
            3 => S::run::<L, T, 3>(level, head, rows, p, all, tokens),
            4 => S::run::<L, T, 4>(level, head, rows, p, all, tokens),
            5 => S::run::<L, T, MAX_BATCH>(level, head, rows, p, all, tokens),
            _ => unreachable!("batches were checked"),
        }
        for r in 0..n {
            self.alone::<L, T, S>(level, head, rows, p, r, self.common.end..self.tokens[r].end);
        }
    }

    /// Has `S` work through `tokens` of the chunk of row `r`.
    #[inline(always)]
    fn alone<L: F32x16, T: Stored, S: Step>(
        &self,
        level: L,
        head: &Head<'_, T>,
        rows: &mut [Row<'_>],
        p: &mut Weights,
        r: usize,
        tokens: Range<usize>,
    ) {
        if !tokens.is_empty() {
            let (row, p) = (&mut rows[r..=r], &mut p[r..=r]);
            S::run::<L, T, 1>(level, head, row, p, &self.tokens[r..=r], tokens);
        }
    }
}

/// One pass over tokens that R rows see: `rows`, `p` and `chunks` are R, and `tokens` lie in each
/// chunk.
trait Step {
    fn run<L: F32x16, T: Stored, const R: usize>(
        level: L,
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
    fn run<L: F32x16, T: Stored, const R: usize>(
        level: L,
        head: &Head<'_, T>,
        rows: &mut [Row<'_>],
        p: &mut [[f32; CHUNK]],
        chunks: &[Range<usize>],
        tokens: Range<usize>,
    ) {
        let mut t = tokens.start;
        while t < tokens.end {
            let n = match tokens.end - t {
                4.. if L::ATTEND_ROOM >= 4 * R => scores::<L, T, R, 4>(level, head, rows, p, chunks, t),
                2.. if L::ATTEND_ROOM >= 2 * R => scores::<L, T, R, 2>(level, head, rows, p, chunks, t),
                _ => scores::<L, T, R, 1>(level, head, rows, p, chunks, t),
            };
            for t in t..t + n {
                // Values are wanted right after the scores.
                let (value, key) = (head.at(&rows[0], t), t + AHEAD);
                prefetch(level, &head.v[value..][..head.dim]);
                if key < tokens.end {
                    prefetch(level, &head.k[head.at(&rows[0], key)..][..head.dim]);
                }
            }
            t += n;
        }
    }
}

#[inline(always)]
fn prefetch<L: F32x16, T>(level: L, row: &[T]) {
    for line in (0..size_of_val(row)).step_by(64) {
        level.prefetch(row.as_ptr().cast::<u8>().wrapping_add(line));
    }
}

/// Dot products of the rows' queries with the keys of tokens `t .. t + N`; returns N.
#[inline(always)]
fn scores<L: F32x16, T: Stored, const R: usize, const N: usize>(
    level: L,
    head: &Head<'_, T>,
    rows: &[Row<'_>],
    p: &mut [[f32; CHUNK]],
    chunks: &[Range<usize>],
    t: usize,
) -> usize {
    let parts = head.dim / 16;
    let mut keys: [&[[T; 16]]; N] = [&[]; N];
    let mut queries: [&[[f32; 16]]; R] = [&[]; R];
    for i in 0..N {
        keys[i] = head.k[head.at(&rows[0], t + i)..][..head.dim].as_chunks().0;
    }
    for r in 0..R {
        queries[r] = rows[r].q[..head.dim].as_chunks().0;
    }
    let mut acc = [[level.zero(); N]; R];
    for j in 0..parts {
        let mut k = [level.zero(); N];
        for i in 0..N {
            k[i] = T::load(level, &keys[i][j]);
        }
        for r in 0..R {
            let q = level.load(&queries[r][j]);
            for i in 0..N {
                acc[r][i] = level.fma(acc[r][i], q, k[i]);
            }
        }
    }
    for r in 0..R {
        for i in 0..N {
            p[r][t + i - chunks[r].start] = level.fold(acc[r][i]);
        }
    }
    N
}

/// y += p v
struct Mix;

impl Step for Mix {
    #[inline(always)]
    fn run<L: F32x16, T: Stored, const R: usize>(
        level: L,
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
            column += match (head.dim - column) / 16 {
                8.. if L::ATTEND_ROOM >= 8 * R => mix::<L, T, R, 8>(level, head, rows, p, chunks, tokens, column),
                4.. if L::ATTEND_ROOM >= 4 * R => mix::<L, T, R, 4>(level, head, rows, p, chunks, tokens, column),
                2.. if L::ATTEND_ROOM >= 2 * R => mix::<L, T, R, 2>(level, head, rows, p, chunks, tokens, column),
                _ => mix::<L, T, R, 1>(level, head, rows, p, chunks, tokens, column),
            };
        }
    }
}

/// Adds the weighted values of `tokens` to 16 N columns of the rows' results; returns their number.
#[inline(always)]
fn mix<L: F32x16, T: Stored, const R: usize, const N: usize>(
    level: L,
    head: &Head<'_, T>,
    rows: &mut [Row<'_>],
    p: &[[f32; CHUNK]],
    chunks: &[Range<usize>],
    tokens: Range<usize>,
    column: usize,
) -> usize {
    let mut acc = [[level.zero(); N]; R];
    for r in 0..R {
        let y = rows[r].y[column..][..16 * N].as_chunks().0;
        for i in 0..N {
            acc[r][i] = level.load(&y[i]);
        }
    }
    for t in tokens {
        let values = head.v[head.at(&rows[0], t) + column..][..16 * N].as_chunks().0;
        let mut weights = [level.zero(); R];
        for r in 0..R {
            weights[r] = level.splat(p[r][t - chunks[r].start]);
        }
        for i in 0..N {
            let v = T::load(level, &values[i]);
            for r in 0..R {
                acc[r][i] = level.fma(acc[r][i], weights[r], v);
            }
        }
    }
    for r in 0..R {
        let y = rows[r].y[column..][..16 * N].as_chunks_mut().0;
        for i in 0..N {
            level.store(acc[r][i], &mut y[i]);
        }
    }
    16 * N
}
