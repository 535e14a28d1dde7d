//! Linear layers: rows in portions, tiles shared out over threads, sums finished by the epilogue.

use super::epilogue::{Finish, RowSums, Sums};
use super::f32x16::Stored;
use super::matrix::{Body, Matrix, Packed};
use super::packed::{Buffer, FloatGeometry, MAX_PANELS, MAX_ROWS, NR, Panels, PrefetchTarget, TILE_COLS, Tile};
use super::quantize_rows::{GROUP, Int8Rows};
use super::rows::{Disjoint, RowTable, by_rows};
use super::{Kernels, matmul_f32_f32, matmul_i8dx_i4g, matmul_i8dx_i8cx};
use crate::par::{Next, Pool};

/// What [`Exec::linear`](super::Exec::linear) does with xW' + b.
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

/// Values between two rows of scratch: rows a multiple of 4 KiB apart would compete for one set of
/// the first-level cache.
const LINE: usize = 64;

/// Scratch of linear layers.
pub(super) struct Scratch {
    /// Largest `in_features`, padded.
    width: usize,
    /// Padded rows of floats.
    x: Buffer,
    int8: Int8Scratch,
}

/// Scratch of quantised rows: what [`Int8Rows`] are made of.
struct Int8Scratch {
    q: Buffer,
    wide: Buffer,
    sums: Vec<i32>,
}

impl Scratch {
    /// For matrices of up to `width` inputs.
    pub(super) fn new(width: usize) -> Self {
        let width = width.max(1).next_multiple_of(GROUP);
        let n = MAX_ROWS * (width + LINE);
        let int8 = Int8Scratch { q: Buffer::new(n), wide: Buffer::new(2 * n), sums: vec![0; n / GROUP] };
        Self { width, x: Buffer::new(4 * n), int8 }
    }

    /// y (`rows` x out) from x (`rows` x in): xW' + b and the epilogue; `after` is what is read
    /// next.
    #[allow(clippy::too_many_arguments, reason = "a layer's operands, and what computes them")]
    pub(super) fn linear(
        &mut self,
        kernels: &Kernels,
        pool: &mut Pool,
        w: &Matrix,
        x: &[f32],
        rows: usize,
        y: &mut [f32],
        epilogue: Epilogue<'_>,
        after: Option<[PrefetchTarget; 2]>,
    ) {
        assert_eq!(x.len(), rows * w.cols, "linear: x is rows x in_features");
        assert_eq!(y.len(), rows * w.out, "linear: y is rows x out_features");
        assert!(w.cols <= self.width, "linear: in_features within the width of Exec::new");
        let most = if w.split { MAX_ROWS / 2 } else { MAX_ROWS };
        for start in (0..rows).step_by(most) {
            let n = most.min(rows - start);
            let x = &x[start * w.cols..][..n * w.cols];
            // Another portion reads these weights again.
            let after = if start + n < rows { w.ends() } else { after };
            let y = Disjoint::new(&mut y[start * w.out..][..n * w.out]);
            self.portion(Portion { kernels, w, x, start, rows: n, y, epilogue, after }, pool);
        }
    }

    /// One arm per type of weights: the rows as the product takes them, then the tiles.
    fn portion(&mut self, portion: Portion<'_>, pool: &mut Pool) {
        let split = portion.w.split;
        match &portion.w.body {
            Body::F32(w) => self.floats(portion, pool, w, |job, tile| w.kernel.run(job, tile)),
            Body::F16(w) => self.floats(portion, pool, w, |job, tile| w.kernel.run(job, tile)),
            Body::I8(w, scale) => {
                let (x, x_scale) = self.int8.quantize(&portion, pool, w.geo.padded, w.kernel.about().wide());
                let (weights, geo) = (w.buffer.of::<u8>(), w.geo);
                let product = |panels: Panels, tile: &mut Tile<i32>| {
                    w.kernel.run(&matmul_i8dx_i8cx::Job { x, weights, geo, panels }, tile);
                };
                portion.run(pool, weights, geo.panel, product, |tile, t, r| {
                    let scale = &scale[t * TILE_COLS..];
                    portion.finish(t, r, Sums::I32(RowSums::of(tile, r, split), x_scale[r], scale));
                });
            }
            Body::I4(w) => {
                let (x, x_scale) = self.int8.quantize(&portion, pool, w.geo.padded(), false);
                let (weights, scales, geo) = (w.buffer.of::<u8>(), w.buffer.of(), w.geo);
                let product = |panels: Panels, tile: &mut Tile<f32>| {
                    w.kernel.run(&matmul_i8dx_i4g::Job { x, weights, scales, geo, panels }, tile);
                };
                portion.run(pool, weights, geo.panel, product, |tile, t, r| {
                    portion.finish(t, r, Sums::F32(RowSums::of(tile, r, split), x_scale[r]));
                });
            }
        }
    }

    /// The arm of float weights, whose activations stay floats.
    fn floats<W: Stored + super::packed::Plain + Sync, O: super::operation::Operation>(
        &mut self,
        portion: Portion<'_>,
        pool: &mut Pool,
        w: &Packed<O, FloatGeometry>,
        run: impl Fn(&matmul_f32_f32::Job<'_, W>, &mut Tile<f32>) + Sync,
    ) {
        let (rows, geo, weights) = (portion.rows, w.geo, w.buffer.of::<W>());
        let (x, stride) = spread(portion.x, rows, portion.w.cols, geo.padded(), &mut self.x);
        let product = |panels: Panels, tile: &mut Tile<f32>| {
            run(&matmul_f32_f32::Job { x, stride, rows, weights, geo, panels }, tile);
        };
        let (bytes, panel) = (w.buffer.of::<u8>(), geo.panel * size_of::<W>());
        portion.run(pool, bytes, panel, product, |tile, t, r| {
            portion.finish(t, r, Sums::F32(RowSums::of(tile, r, false), 1.0));
        });
    }
}

/// At most 16 rows of a layer, 8 of those that are split.
#[derive(Clone, Copy)]
struct Portion<'a> {
    kernels: &'a Kernels,
    w: &'a Matrix,
    x: &'a [f32],
    /// The first row's number in gate tables.
    start: usize,
    rows: usize,
    y: Disjoint,
    epilogue: Epilogue<'a>,
    /// What is read next: from its first tile on, or from its last.
    after: Option<[PrefetchTarget; 2]>,
}

impl Portion<'_> {
    /// Each tile: the sums by `product`, then `finish` for the tile's number and that of each row,
    /// while the sums are in the first-level cache. `weights` have panels of `panel` bytes.
    fn run<T: Copy + Default>(
        &self,
        pool: &mut Pool,
        weights: &[u8],
        panel: usize,
        product: impl Fn(Panels, &mut Tile<T>) + Sync,
        finish: impl Fn(&Tile<T>, usize, usize) + Sync,
    ) {
        let panels = self.w.out.div_ceil(NR);
        pool.run(panels.div_ceil(MAX_PANELS), &|t, next| {
            // Where this thread reads on: in this matrix, or at an end of the next one.
            let next = match (next, self.after) {
                (Next::Piece(tile), _) => PrefetchTarget::new(weights, tile * MAX_PANELS * panel, panel),
                (Next::First, Some([first, _])) => first,
                (Next::Last, Some([_, last])) => last,
                (Next::First | Next::Last, None) => PrefetchTarget::new(weights, 0, panel),
            };
            let first = t * MAX_PANELS;
            let mut tile: Tile<T> = [[T::default(); TILE_COLS]; MAX_ROWS];
            product(Panels { first, count: MAX_PANELS.min(panels - first), next }, &mut tile);
            (0..self.rows).for_each(|r| finish(&tile, t, r));
        });
    }

    /// Finishes one row of one tile.
    fn finish(&self, tile: usize, r: usize, sums: Sums<'_>) {
        let from = tile * TILE_COLS;
        let len = TILE_COLS.min(self.w.out - from);
        let finish = match self.epilogue {
            Epilogue::Store => Finish::Store,
            Epilogue::Gelu => Finish::Gelu,
            Epilogue::Add => Finish::Add,
            Epilogue::GatedAdd(gate) => Finish::GatedAdd(gate.part(self.start + r, from, len)),
        };
        // SAFETY: row r and the tile's columns lie in y, and each tile is one piece.
        let y = unsafe { self.y.part(r * self.w.out + from, len) };
        self.kernels.epilogue.run(sums, &self.w.bias[from..], finish, y);
    }
}

/// `x` itself when its rows have the padded length and are few and not too far apart, else a copy
/// with zeros behind each row; and the distance of its rows.
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

impl Int8Scratch {
    /// Quantises each row into one row of int8, or two where the layer has rows split, that are
    /// `padded` and a line apart; returns them, and the rows' scales.
    fn quantize(
        &mut self,
        portion: &Portion<'_>,
        pool: &mut Pool,
        padded: usize,
        wide: bool,
    ) -> (Int8Rows<'_>, [f32; MAX_ROWS]) {
        let Portion { kernels, w, x, rows, .. } = *portion;
        let (stride, groups) = (padded + LINE, padded / GROUP);
        let int8_rows = if w.split { 2 * rows } else { rows };
        let q = &mut self.q.of_mut::<i8>()[..int8_rows * stride];
        let sums = &mut self.sums[..int8_rows * groups];
        let mut scales = [0.0; MAX_ROWS];
        let (all_q, all_sums, scale) = (Disjoint::new(q), Disjoint::new(sums), Disjoint::new(&mut scales));
        by_rows(pool, rows, x.len(), &|r| {
            let x = &x[r * w.cols..][..w.cols];
            // SAFETY: q has a padded row every stride, or two of them, sums their groups and scales
            // an element for each row of x; a row is one piece.
            let row = |r: usize| unsafe { (all_q.part(r * stride, padded), all_sums.part(r * groups, groups)) };
            // SAFETY: as above.
            let scale = unsafe { scale.part(r, 1) };
            scale[0] = if w.split {
                let ((high, high_sums), (low, low_sums)) = (row(2 * r), row(2 * r + 1));
                kernels.split.run(x, [high, low], [high_sums, low_sums])
            } else {
                let (q, sums) = row(r);
                kernels.quantize.run(x, q, sums)
            };
        });
        let wide = &mut self.wide.of_mut::<i16>()[..if wide { q.len() } else { 0 }];
        for (wide, q) in wide.iter_mut().zip(&*q) {
            *wide = i16::from(*q);
        }
        (Int8Rows { q, wide, sums, stride, rows: int8_rows }, scales)
    }
}
