//! Linear layers on an [`Exec`]: rows in portions, tiles shared out over threads, sums finished by the epilogue.

use super::epilogue::{Finish, Sums};
use super::exec::{Exec, RowTable, Shared};
use super::matrix::{Body, Matrix};
use super::packed::{Buffer, MAX_PANELS, MAX_ROWS, NR, Onward, TILE_COLS, Tile};
use super::quantize_rows::GROUP;
use super::{Kernels, matmul_f32_f32, matmul_i8dx_i4g, matmul_i8dx_i8cx};
use crate::par::{Next, Pool};

/// What [`Exec::linear`] does with xW' + b.
#[derive(Debug, Clone, Copy)]
pub enum Epilogue<'a> {
    /// y = xW' + b
    Store,
    /// y = gelu(xW' + b)
    Gelu,
    /// y += xW' + b
    Add,
    /// y += gate\[row\] * (xW' + b)
    GatedAdd(RowTable<'a>),
}

impl Exec {
    /// y (`rows` x out) from x (`rows` x in): xW' + b and the epilogue.
    pub fn linear(&mut self, w: &Matrix, x: &[f32], rows: usize, y: &mut [f32], e: Epilogue<'_>) {
        assert_eq!(x.len(), rows * w.cols, "linear: x is rows x in_features");
        assert_eq!(y.len(), rows * w.out, "linear: y is rows x out_features");
        assert!(w.cols <= self.width, "linear: in_features within Limits::width");
        if let Some(activations) = &mut self.activations {
            activations.listen(&w.name, x, w.cols);
        }
        let upcoming = self.upcoming.take();
        let most = if w.split { MAX_ROWS / 2 } else { MAX_ROWS };
        for start in (0..rows).step_by(most) {
            let n = most.min(rows - start);
            let x = &x[start * w.cols..][..n * w.cols];
            // Another portion reads these weights again.
            let after = if start + n < rows { w.ends() } else { upcoming };
            self.portion(w, x, start, n, &mut y[start * w.out..][..n * w.out], e, after);
        }
    }

    /// Says that the linear layer after the next one is of `w`: threads that run out of the one's weights prefetch the other's.
    pub fn expect(&mut self, w: &Matrix) {
        self.upcoming = w.ends();
    }

    /// At most 16 rows, 8 of those that are split; `start` is the first one's number in gate tables, `after` what is read next.
    #[allow(clippy::too_many_arguments, reason = "a layer's operands, and where they are in the whole")]
    fn portion(
        &mut self,
        w: &Matrix,
        x: &[f32],
        start: usize,
        rows: usize,
        y: &mut [f32],
        e: Epilogue<'_>,
        after: Option<[Onward; 2]>,
    ) {
        let Self { kernels, pool, x: padded, q, wide, sums, .. } = self;
        let y = Shared(y.as_mut_ptr());
        let rows_of_q = if w.split { 2 * rows } else { rows };
        let panels = w.out.div_ceil(NR);
        let tiles = panels.div_ceil(MAX_PANELS);
        // Finishes one row of one tile; `sums` starts at the tile's first column.
        let finish = |tile: usize, r: usize, sums: Sums<'_>| {
            let from = tile * TILE_COLS;
            let len = TILE_COLS.min(w.out - from);
            let finish = match e {
                Epilogue::Store => Finish::Store,
                Epilogue::Gelu => Finish::Gelu,
                Epilogue::Add => Finish::Add,
                Epilogue::GatedAdd(gate) => Finish::GatedAdd(gate.part(start + r, from, len)),
            };
            // SAFETY: row r and the tile's columns lie in y, and each tile is one piece.
            let y = unsafe { y.part(r * w.out + from, len) };
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            unsafe { (kernels.epilogue.run)(sums, &w.bias[from..], finish, y) }
        };
        let span = |tile: usize| (tile * MAX_PANELS, MAX_PANELS.min(panels - tile * MAX_PANELS));
        // Where a thread reads on: in this matrix, or at an end of the next one.
        let onward = |next: Next, weights: &[u8], panel: usize| match (next, after) {
            (Next::Piece(tile), _) => Onward::new(weights, tile * MAX_PANELS * panel, panel),
            (Next::First, Some([first, _])) => first,
            (Next::Last, Some([_, last])) => last,
            (Next::First | Next::Last, None) => Onward::new(weights, 0, panel),
        };

        match &w.body {
            Body::F32(buffer, geo, variant) => {
                let (x, stride) = spread(x, rows, w.cols, geo.padded(), padded);
                let weights = buffer.of::<f32>();
                pool.run(tiles, &|t, _| {
                    let (first, panels) = span(t);
                    let mut tile: Tile<f32> = [[0.0; TILE_COLS]; MAX_ROWS];
                    let job = matmul_f32_f32::Job { x, stride, rows, weights, geo: *geo, first, panels };
                    // SAFETY: a matrix holds a variant that this CPU can run.
                    unsafe { (variant.run)(&job, &mut tile) };
                    (0..rows).for_each(|r| finish(t, r, Sums::F32(&tile[r])));
                });
            }
            Body::F16(buffer, geo, variant) => {
                let (x, stride) = spread(x, rows, w.cols, geo.padded(), padded);
                let weights = buffer.of::<half::f16>();
                pool.run(tiles, &|t, _| {
                    let (first, panels) = span(t);
                    let mut tile: Tile<f32> = [[0.0; TILE_COLS]; MAX_ROWS];
                    let job = matmul_f32_f32::Job { x, stride, rows, weights, geo: *geo, first, panels };
                    // SAFETY: a matrix holds a variant that this CPU can run.
                    unsafe { (variant.run)(&job, &mut tile) };
                    (0..rows).for_each(|r| finish(t, r, Sums::F32(&tile[r])));
                });
            }
            Body::I8(buffer, geo, scale, variant) => {
                let stride = geo.padded + LINE;
                let n = rows_of_q * stride;
                let (q, sums) = (&mut q.of_mut::<i8>()[..n], &mut sums[..rows_of_q * geo.padded / GROUP]);
                let x_scale = &quantize(kernels, pool, w, x, geo.padded, q, sums)[..rows];
                let wide = &mut wide.of_mut::<i16>()[..if variant.run.wide { n } else { 0 }];
                for (wide, q) in wide.iter_mut().zip(&*q) {
                    *wide = i16::from(*q);
                }
                let (q, sums, wide, weights) = (&*q, &*sums, &*wide, buffer.of::<u8>());
                pool.run(tiles, &|t, next| {
                    let (first, panels) = span(t);
                    let mut tile: Tile<i32> = [[0; TILE_COLS]; MAX_ROWS];
                    let next = onward(next, weights, geo.panel);
                    let (geo, rows) = (*geo, rows_of_q);
                    let job = matmul_i8dx_i8cx::Job { q, wide, sums, stride, rows, weights, geo, first, panels, next };
                    // SAFETY: a matrix holds a variant that this CPU can run.
                    unsafe { (variant.run.run)(&job, &mut tile) };
                    let scale = &scale[t * TILE_COLS..];
                    for (r, &x_scale) in x_scale.iter().enumerate() {
                        let sums = if w.split {
                            Sums::I32Pair([&tile[2 * r], &tile[2 * r + 1]], x_scale, scale)
                        } else {
                            Sums::I32(&tile[r], x_scale, scale)
                        };
                        finish(t, r, sums);
                    }
                });
            }
            Body::I4(buffer, geo, variant) => {
                let stride = geo.padded() + LINE;
                let (q, sums) = (&mut q.of_mut::<i8>()[..rows_of_q * stride], &mut sums[..rows_of_q * geo.groups]);
                let x_scale = &quantize(kernels, pool, w, x, geo.padded(), q, sums)[..rows];
                let (q, sums) = (&*q, &*sums);
                let (weights, scales) = (buffer.of::<u8>(), buffer.of::<half::f16>());
                pool.run(tiles, &|t, next| {
                    let (first, panels) = span(t);
                    let mut tile: Tile<f32> = [[0.0; TILE_COLS]; MAX_ROWS];
                    let next = onward(next, weights, geo.panel);
                    let (geo, rows) = (*geo, rows_of_q);
                    let job = matmul_i8dx_i4g::Job { q, sums, stride, rows, weights, scales, geo, first, panels, next };
                    // SAFETY: a matrix holds a variant that this CPU can run.
                    unsafe { (variant.run)(&job, &mut tile) };
                    for (r, &x_scale) in x_scale.iter().enumerate() {
                        let sums = if w.split {
                            Sums::ScaledPair([&tile[2 * r], &tile[2 * r + 1]], x_scale)
                        } else {
                            Sums::Scaled(&tile[r], x_scale)
                        };
                        finish(t, r, sums);
                    }
                });
            }
        }
    }
}

/// Values between two rows of scratch: rows a multiple of 4 KiB apart would compete for one set of the first-level cache.
pub(super) const LINE: usize = 64;

/// `x` itself when its rows have the padded length and are few and not too far apart, else a copy with zeros behind each row; and
/// the distance of its rows.
fn spread<'a>(x: &'a [f32], rows: usize, cols: usize, padded: usize, scratch: &'a mut Buffer) -> (&'a [f32], usize) {
    if cols == padded && (rows == 1 || rows <= 4 && !cols.is_multiple_of(4096)) {
        return (x, cols);
    }
    let stride = padded + LINE / 4;
    let scratch = &mut scratch.of_mut::<f32>()[..rows * stride];
    for (from, to) in x.chunks_exact(cols).zip(scratch.chunks_exact_mut(stride)) {
        to[..cols].copy_from_slice(from);
        to[cols..].fill(0.0);
    }
    (scratch, stride)
}

/// Quantises each row of `x` into a row of `q`, or two where `w` has rows split, that are `padded` and a line apart; returns the rows' scales.
fn quantize(
    kernels: &Kernels,
    pool: &mut Pool,
    w: &Matrix,
    x: &[f32],
    padded: usize,
    q: &mut [i8],
    sums: &mut [i32],
) -> [f32; MAX_ROWS] {
    let mut scales = [0.0; MAX_ROWS];
    let (stride, groups) = (padded + LINE, padded / GROUP);
    let (q, sums, scale) = (Shared(q.as_mut_ptr()), Shared(sums.as_mut_ptr()), Shared(scales.as_mut_ptr()));
    by_rows(pool, x.len() / w.cols, x.len(), &|r| {
        let x = &x[r * w.cols..][..w.cols];
        // SAFETY: q has a padded row a stride, or two of them, sums their groups and scales an element for each row of x; a row is one piece.
        let row = |r: usize| unsafe { (q.part(r * stride, padded), sums.part(r * groups, groups)) };
        // SAFETY: as above.
        let scale = unsafe { scale.part(r, 1) };
        if w.split {
            let ((high, high_sums), (low, low_sums)) = (row(2 * r), row(2 * r + 1));
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            scale[0] = unsafe { (kernels.split.run)(x, [high, low], [high_sums, low_sums]) };
        } else {
            let (q, sums) = row(r);
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            scale[0] = unsafe { (kernels.quantize.run)(x, q, sums) };
        }
    });
    scales
}

/// Values of a few rows from which on sharing them out pays for telling the other thread.
const WORTH_SHARING: usize = 2048;

/// Calls `work` for each of `rows` rows, on both threads where `values`, the number of values in all of them, makes it worth it.
pub(super) fn by_rows(pool: &mut Pool, rows: usize, values: usize, work: &(dyn Fn(usize) + Sync)) {
    if values < WORTH_SHARING {
        (0..rows).for_each(work);
    } else {
        pool.run(rows, &|row, _| work(row));
    }
}
