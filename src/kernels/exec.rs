//! [`Exec`]: kernels, threads and scratch of one session; the one object that networks call.

use super::attend::{Head, KvCache, Span};
use super::epilogue::{Finish, Sums};
use super::matrix::{Body, Matrix};
use super::packed::{Buffer, MAX_PANELS, MAX_ROWS, NR, TILE_COLS, Tile};
use super::quantize_rows::GROUP;
use super::{Kernels, matmul_f32_f32, matmul_i8dx_i4g, matmul_i8dx_i8cx};
use crate::error::{Error, ErrorKind, Result};
use crate::par::{FlushToZero, Pool};

/// Row r of a table of vectors is `table[index[r] * stride + offset ..][..dim]`.
///
/// One vector for all rows: `stride` 0 and any index. Modulation that depends on a row's flow time: `index` is its slot.
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

/// Sizes that scratch is allocated for.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Rows of a call, typically; more are worked through in portions of 16.
    pub rows: usize,
    /// Largest `in_features` of any matrix.
    pub width: usize,
}

/// Kernels, threads and scratch of one session.
///
/// After [`new`](Self::new) no method allocates, locks or enters the kernel, but for [`begin`](Self::begin) and
/// [`end`](Self::end), between which the second thread helps; outside of them the methods work, on the calling thread alone.
/// Results have the same bits with one and two threads: work is split over results, never over a sum. But for flush-to-zero,
/// they also have the same bits inside and outside.
///
/// Methods panic when lengths disagree with the shapes in their description: that is an error of the program.
pub struct Exec {
    kernels: Kernels,
    pool: Pool,
    width: usize,
    x: Buffer,
    q: Buffer,
    wide: Buffer,
    sums: Vec<i32>,
    flush: Option<FlushToZero>,
}

/// A pointer that the pieces of one run share; each writes a part of its own.
#[derive(Clone, Copy)]
struct Shared(*mut f32);
// SAFETY: pieces that hold it write disjoint ranges, which each use argues.
unsafe impl Sync for Shared {}

impl Shared {
    /// `len` values from `from`.
    ///
    /// # Safety
    /// The range lies in the slice that the pointer came from, and no other reference to it lives meanwhile.
    unsafe fn part<'a>(&self, from: usize, len: usize) -> &'a mut [f32] {
        // SAFETY: promised by the caller.
        unsafe { std::slice::from_raw_parts_mut(self.0.add(from), len) }
    }
}

impl Exec {
    /// Allocates scratch and, for `threads` = 2, starts the helper thread.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when `threads` is not 1 or 2; [`ErrorKind::Io`] when the thread cannot be started.
    pub fn new(kernels: Kernels, threads: usize, limits: Limits) -> Result<Exec> {
        if !(1..=2).contains(&threads) {
            return Err(Error::new(ErrorKind::Argument, format!("threads = {threads}: use 1 or 2")));
        }
        let pool = Pool::new(threads)
            .map_err(|e| Error::new(ErrorKind::Io, format!("cannot start a second thread ({e}): use 1 thread")))?;
        let width = limits.width.max(1).next_multiple_of(GROUP);
        let n = MAX_ROWS * (width + LINE);
        Ok(Exec {
            kernels,
            pool,
            width,
            x: Buffer::new(4 * n),
            q: Buffer::new(n),
            wide: Buffer::new(2 * n),
            sums: vec![0; n / GROUP],
            flush: None,
        })
    }

    /// The kernels in use.
    pub fn kernels(&self) -> Kernels {
        self.kernels
    }

    /// Number of threads: 1 or 2.
    pub fn threads(&self) -> usize {
        self.pool.threads()
    }

    /// Starts a stretch of work: the helper wakes up and spins, and denormals count as zero on both threads. Calling it twice is harmless.
    pub fn begin(&mut self) {
        self.flush.get_or_insert_with(FlushToZero::new);
        self.pool.begin();
    }

    /// Ends it, on the thread that began it: the helper parks and the floating-point mode is as before.
    pub fn end(&mut self) {
        self.pool.end();
        self.flush = None;
    }

    /// y (`rows` x out) from x (`rows` x in): xW' + b and the epilogue.
    pub fn linear(&mut self, w: &Matrix, x: &[f32], rows: usize, y: &mut [f32], e: Epilogue<'_>) {
        assert_eq!(x.len(), rows * w.cols, "linear: x is rows x in_features");
        assert_eq!(y.len(), rows * w.out, "linear: y is rows x out_features");
        assert!(w.cols <= self.width, "linear: in_features within Limits::width");
        for start in (0..rows).step_by(MAX_ROWS) {
            let n = MAX_ROWS.min(rows - start);
            let x = &x[start * w.cols..][..n * w.cols];
            self.portion(w, x, start, n, &mut y[start * w.out..][..n * w.out], e);
        }
    }

    /// At most 16 rows; `start` is the first one's number in gate tables.
    fn portion(&mut self, w: &Matrix, x: &[f32], start: usize, rows: usize, y: &mut [f32], e: Epilogue<'_>) {
        let Self { kernels, pool, x: padded, q, wide, sums, .. } = self;
        let y = Shared(y.as_mut_ptr());
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

        match &w.body {
            Body::F32(buffer, geo, variant) => {
                let (x, stride) = spread(x, rows, w.cols, geo.padded(), padded);
                let weights = buffer.of::<f32>();
                pool.run(tiles, &|t| {
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
                pool.run(tiles, &|t| {
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
                let n = rows * stride;
                let (q, sums) = (&mut q.of_mut::<i8>()[..n], &mut sums[..rows * geo.padded / GROUP]);
                let x_scale = quantize(kernels, x, w.cols, geo.padded, q, sums);
                let wide = &mut wide.of_mut::<i16>()[..if variant.run.wide { n } else { 0 }];
                for (wide, q) in wide.iter_mut().zip(&*q) {
                    *wide = i16::from(*q);
                }
                let (q, sums, wide, weights) = (&*q, &*sums, &*wide, buffer.of::<u8>());
                pool.run(tiles, &|t| {
                    let (first, panels) = span(t);
                    let mut tile: Tile<i32> = [[0; TILE_COLS]; MAX_ROWS];
                    let job = matmul_i8dx_i8cx::Job { q, wide, sums, stride, rows, weights, geo: *geo, first, panels };
                    // SAFETY: a matrix holds a variant that this CPU can run.
                    unsafe { (variant.run.run)(&job, &mut tile) };
                    (0..rows).for_each(|r| finish(t, r, Sums::I32(&tile[r], x_scale[r], &scale[t * TILE_COLS..])));
                });
            }
            Body::I4(buffer, geo, variant) => {
                let stride = geo.padded() + LINE;
                let (q, sums) = (&mut q.of_mut::<i8>()[..rows * stride], &mut sums[..rows * geo.groups]);
                let x_scale = quantize(kernels, x, w.cols, geo.padded(), q, sums);
                let (q, sums) = (&*q, &*sums);
                let (weights, scales) = (buffer.of::<u8>(), buffer.of::<half::f16>());
                pool.run(tiles, &|t| {
                    let (first, panels) = span(t);
                    let mut tile: Tile<f32> = [[0.0; TILE_COLS]; MAX_ROWS];
                    let job = matmul_i8dx_i4g::Job { q, sums, stride, rows, weights, scales, geo: *geo, first, panels };
                    // SAFETY: a matrix holds a variant that this CPU can run.
                    unsafe { (variant.run)(&job, &mut tile) };
                    (0..rows).for_each(|r| finish(t, r, Sums::Scaled(&tile[r], x_scale[r])));
                });
            }
        }
    }

    /// Layer normalisation of each of `rows` rows of `dim` values, eps 1e-5: y = layernorm(x) * scale + shift, `scale` holding 1 + s.
    pub fn norm(
        &mut self,
        x: &[f32],
        rows: usize,
        dim: usize,
        shift: RowTable<'_>,
        scale: RowTable<'_>,
        y: &mut [f32],
    ) {
        assert!(x.len() == rows * dim && y.len() == rows * dim, "norm: x and y are rows x dim");
        for (r, (x, y)) in x.chunks_exact(dim).zip(y.chunks_exact_mut(dim)).enumerate() {
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            unsafe { (self.kernels.norm.run)(x, shift.part(r, 0, dim), scale.part(r, 0, dim), y) }
        }
    }

    /// Rotary positions, half-split, on the first `heads * head_dim` values of each of `rows` rows of `row_stride` values;
    /// `cos` and `sin` are `rows` x `head_dim / 2`.
    #[allow(clippy::too_many_arguments, reason = "a kernel's operands and shape")]
    pub fn rope(
        &mut self,
        x: &mut [f32],
        rows: usize,
        row_stride: usize,
        heads: usize,
        head_dim: usize,
        cos: &[f32],
        sin: &[f32],
    ) {
        let half = head_dim / 2;
        assert!(
            half > 0 && head_dim == 2 * half && heads * head_dim <= row_stride,
            "rope: even head_dim, heads in a row"
        );
        assert!(x.len() == rows * row_stride, "rope: x is rows x row_stride");
        assert!(cos.len() == rows * half && sin.len() == rows * half, "rope: cos and sin are rows x head_dim/2");
        for (r, x) in x.chunks_exact_mut(row_stride).enumerate() {
            let at = r * half..(r + 1) * half;
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            unsafe { (self.kernels.rope.run)(&mut x[..heads * head_dim], &cos[at.clone()], &sin[at]) }
        }
    }

    /// Attention: row r of `q` (`row_stride` values, of which the first `cache.dim()` are the heads' queries) over `spans[r]`,
    /// scores divided by sqrt(head_dim), into row r of `y` (`spans.len()` x `cache.dim()`).
    pub fn attend(
        &mut self,
        q: &[f32],
        row_stride: usize,
        heads: usize,
        cache: &KvCache,
        spans: &[Span],
        y: &mut [f32],
    ) {
        let (rows, dim) = (spans.len(), cache.dim());
        assert!(
            heads > 0 && dim.is_multiple_of(heads) && dim <= row_stride,
            "attend: heads divide dim, dim fits a row"
        );
        assert!(q.len() == rows * row_stride && y.len() == rows * dim, "attend: q is rows x row_stride, y rows x dim");
        for s in spans {
            assert!(
                (s.ring as usize) < cache.rings() && s.len as usize <= cache.capacity(),
                "attend: span in the cache"
            );
        }
        let head_dim = dim / heads;
        let kernels = &self.kernels;
        let y = Shared(y.as_mut_ptr());
        // Neighbouring rows often share a ring, so one piece is one head of up to 4 rows: its keys stay in the cache.
        let groups = rows.div_ceil(4);
        self.pool.run(groups * heads, &|piece| {
            let (head, group) = (piece % heads, piece / heads);
            for r in group * 4..rows.min(group * 4 + 4) {
                let q = &q[r * row_stride + head * head_dim..][..head_dim];
                // SAFETY: in y, and each row's head is in one piece.
                let y = unsafe { y.part(r * dim + head * head_dim, head_dim) };
                let (offset, span) = (head * head_dim, spans[r]);
                // SAFETY: a `Kernels` exists only for a level that this CPU has.
                unsafe {
                    match &cache.store {
                        super::attend::Store::F16(k, v) => {
                            (kernels.attend.run.f16)(&ring(cache, k, v, span, offset), q, y);
                        }
                        super::attend::Store::F32(k, v) => {
                            (kernels.attend.run.f32)(&ring(cache, k, v, span, offset), q, y);
                        }
                    }
                }
            }
        });
    }

    /// GELU, tanh form, in place.
    pub fn gelu(&mut self, x: &mut [f32]) {
        // SAFETY: a `Kernels` exists only for a level that this CPU has.
        unsafe { (self.kernels.gelu.run.gelu)(x) }
    }

    /// x / (1 + e^-x) in place.
    pub fn silu(&mut self, x: &mut [f32]) {
        // SAFETY: a `Kernels` exists only for a level that this CPU has.
        unsafe { (self.kernels.gelu.run.silu)(x) }
    }
}

impl std::fmt::Debug for Exec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Exec({}, {} threads)", self.kernels.level(), self.threads())
    }
}

fn ring<'a, T>(cache: &KvCache, k: &'a [T], v: &'a [T], span: Span, offset: usize) -> Head<'a, T> {
    let n = cache.capacity * cache.dim;
    let at = span.ring as usize * n..(span.ring as usize + 1) * n;
    Head {
        k: &k[at.clone()],
        v: &v[at],
        stride: cache.dim,
        offset,
        capacity: cache.capacity,
        slot: cache.slot(span.first),
        len: span.len as usize,
    }
}

/// Values between two rows of scratch: rows a multiple of 4 KiB apart would compete for one set of the first-level cache.
const LINE: usize = 64;

/// `x` itself when its few rows have the padded length, else a copy with zeros behind each row; and the distance of its rows.
fn spread<'a>(x: &'a [f32], rows: usize, cols: usize, padded: usize, scratch: &'a mut Buffer) -> (&'a [f32], usize) {
    if cols == padded && rows <= 4 {
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

/// Quantises each row of `x` into rows of `q` that are `padded` and a line apart; returns the rows' scales.
fn quantize(
    kernels: &Kernels,
    x: &[f32],
    cols: usize,
    padded: usize,
    q: &mut [i8],
    sums: &mut [i32],
) -> [f32; MAX_ROWS] {
    let mut scales = [0.0; MAX_ROWS];
    let rows = x.chunks_exact(cols).zip(q.chunks_exact_mut(padded + LINE)).zip(sums.chunks_exact_mut(padded / GROUP));
    for (scale, ((x, q), sums)) in scales.iter_mut().zip(rows) {
        // SAFETY: a `Kernels` exists only for a level that this CPU has.
        *scale = unsafe { (kernels.quantize.run)(x, &mut q[..padded], sums) };
    }
    scales
}
