//! [`Exec`]: kernels, threads and scratch of one session; the one object that networks call.

use super::Kernels;
use super::activations::Activations;
use super::attend::{Head, HeadOf, KvCache, MAX_BATCH, MAX_SPANS, Row, Span, Store, batches};
use super::gelu::Activation;
use super::linear::{Epilogue, Scratch};
use super::matrix::Matrix;
use super::packed::PrefetchTarget;
use super::rows::{Disjoint, RowTable, by_rows};
use crate::error::{Error, ErrorKind, Result};
use crate::par::{FlushToZero, Pool};

/// Kernels, threads and scratch of one session.
///
/// After [`new`](Self::new) no method allocates, locks or enters the kernel, but for
/// [`begin`](Self::begin) and [`end`](Self::end), between which the second thread helps; outside of
/// them the methods work, on the calling thread alone. Results have the same bits with one and two
/// threads: work is split over results, never over a sum. But for flush-to-zero, they also have the
/// same bits inside and outside.
///
/// Methods panic when lengths disagree with the shapes in their description: that is an error of
/// the program.
pub struct Exec {
    pub(super) kernels: Kernels,
    pub(super) pool: Pool,
    scratch: Scratch,
    /// Where the linear layer after the next one begins.
    upcoming: Option<[PrefetchTarget; 2]>,
    flush: Option<FlushToZero>,
    pub(super) activations: Option<Activations>,
    /// What each thread has to itself while things are shared out whole.
    pub(super) workers: Option<Box<[Exec; 2]>>,
}

impl Exec {
    /// Allocates scratch for matrices of up to `width` `in_features` (and any number of rows) and,
    /// for `threads` = 2, starts the helper thread.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] when `threads` is not 1 or 2; [`ErrorKind::Io`] when the thread
    /// cannot be started.
    pub fn new(kernels: Kernels, threads: usize, width: usize) -> Result<Exec> {
        if !(1..=2).contains(&threads) {
            return Err(Error::new(ErrorKind::Argument, format!("threads = {threads}: use 1 or 2")));
        }
        let pool = Pool::new(threads)
            .map_err(|e| Error::new(ErrorKind::Io, format!("cannot start a second thread ({e}): use 1 thread")))?;
        Ok(Exec {
            kernels,
            pool,
            scratch: Scratch::new(width),
            upcoming: None,
            flush: None,
            activations: None,
            workers: None,
        })
    }

    /// The kernels in use.
    #[cfg(feature = "internals")]
    pub fn kernels(&self) -> Kernels {
        self.kernels
    }

    /// Number of threads: 1 or 2.
    pub fn threads(&self) -> usize {
        self.pool.threads()
    }

    /// The pool of threads.
    pub fn pool(&self) -> &Pool {
        &self.pool
    }

    /// Lets `activations` listen to the linear layers from here on (`None`: nobody) and returns
    /// what listened so far.
    #[cfg(feature = "internals")]
    pub fn listen(&mut self, activations: Option<Activations>) -> Option<Activations> {
        std::mem::replace(&mut self.activations, activations)
    }

    /// Starts a stretch of work: the helper wakes up and spins, and denormals count as zero on both
    /// threads. Calling it twice is harmless.
    pub fn begin(&mut self) {
        self.flush.get_or_insert_with(FlushToZero::new);
        self.pool.begin();
    }

    /// Ends it, on the thread that began it: the helper parks and the floating-point mode is as
    /// before.
    pub fn end(&mut self) {
        self.pool.end();
        self.flush = None;
    }

    /// y (`rows` x out) from x (`rows` x in): xW' + b and the epilogue.
    pub fn linear(&mut self, w: &Matrix, x: &[f32], rows: usize, y: &mut [f32], e: Epilogue<'_>) {
        if let Some(activations) = &mut self.activations {
            activations.listen(&w.name, x, w.in_features());
        }
        let after = self.upcoming.take();
        self.scratch.linear(&self.kernels, &mut self.pool, w, x, rows, y, e, after);
    }

    /// Says that the linear layer after the next one is of `w`: threads that run out of the one's
    /// weights prefetch the other's.
    pub fn expect(&mut self, w: &Matrix) {
        self.upcoming = w.ends();
    }

    /// Layer normalisation of each of `rows` rows of `dim` values, eps 1e-5: y = layernorm(x) *
    /// scale + shift, `scale` holding 1 + s.
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
        let (kernels, y) = (&self.kernels, Disjoint::new(y));
        by_rows(&mut self.pool, rows, x.len(), &|r| {
            // SAFETY: row r of y, in one piece.
            let y = unsafe { y.part(r * dim, dim) };
            kernels.norm.run(&x[r * dim..][..dim], shift.part(r, 0, dim), scale.part(r, 0, dim), y);
        });
    }

    /// Rotary positions, half-split, on the first `heads * head_dim` values of each of `rows` rows
    /// of `row_stride` values; `cos` and `sin` are `rows` x `head_dim / 2`.
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
        let (kernels, values, x) = (&self.kernels, x.len(), Disjoint::new(x));
        by_rows(&mut self.pool, rows, values, &|r| {
            let at = r * half..(r + 1) * half;
            // SAFETY: whole heads within row r of x, in one piece.
            let x = unsafe { x.part(r * row_stride, heads * head_dim) };
            kernels.rope.run(x, &cos[at.clone()], &sin[at]);
        });
    }

    /// Attention: row r of `q` (`row_stride` values, of which the first `cache.dim()` are the
    /// heads' queries) over `spans[r]`, scores divided by sqrt(head_dim), into row r of `y`
    /// (`spans.len()` x `cache.dim()`).
    pub fn attend(&mut self, q: &[f32], row_stride: usize, cache: &KvCache, spans: &[Span], y: &mut [f32]) {
        let (rows, dim, heads, head_dim) = (spans.len(), cache.dim(), cache.heads(), cache.head_dim());
        assert!(dim <= row_stride, "attend: dim fits a row");
        assert!(q.len() == rows * row_stride && y.len() == rows * dim, "attend: q is rows x row_stride, y rows x dim");
        for s in spans {
            assert!(
                (s.ring as usize) < cache.rings() && s.len as usize <= cache.capacity(),
                "attend: span in the cache"
            );
        }
        let (kernels, y) = (&self.kernels, Disjoint::new(y));
        for start in (0..rows).step_by(MAX_SPANS) {
            let spans = &spans[start..rows.min(start + MAX_SPANS)];
            let (batches, n) = batches(spans);
            // One piece is one head of one batch: a batch's keys are read once.
            self.pool.run(n * heads, &|piece, _| {
                let (head, batch) = (piece % heads, batches[piece / heads].rows());
                let first = batch.iter().map(|&i| spans[usize::from(i)].first).min().unwrap_or(0);
                let mut rows: [Row<'_>; MAX_BATCH] = std::array::from_fn(|i| match batch.get(i) {
                    Some(&i) => {
                        let (r, span) = (start + usize::from(i), spans[usize::from(i)]);
                        Row {
                            q: &q[r * row_stride + head * head_dim..][..head_dim],
                            // SAFETY: in y, and each row's head is in one piece.
                            y: unsafe { y.part(r * dim + head * head_dim, head_dim) },
                            first: cache.index(span.first),
                            len: span.len as usize,
                            shift: (span.first - first) as usize,
                        }
                    }
                    None => Row { q: &[], y: &mut [], first: 0, len: 0, shift: 0 },
                });
                let (rows, ring) = (&mut rows[..batch.len()], spans[usize::from(batch[0])].ring);
                let head = match &cache.store {
                    Store::F16(k, v) => HeadOf::F16(seen(cache, k.of(), v.of(), ring, head)),
                    Store::F32(k, v) => HeadOf::F32(seen(cache, k.of(), v.of(), ring, head)),
                };
                kernels.attend.run(head, rows);
            });
        }
    }

    /// GELU, tanh form, in place.
    #[cfg(feature = "internals")]
    pub fn gelu(&mut self, x: &mut [f32]) {
        self.kernels.gelu.run(Activation::Gelu, x);
    }

    /// x / (1 + e^-x) in place.
    pub fn silu(&mut self, x: &mut [f32]) {
        self.kernels.gelu.run(Activation::Silu, x);
    }

    /// One step of a row of LSTM cells `c`, `h` values each, from `gates` (i, f, g, o, `c.len()`
    /// values each): c = sigmoid(f) c + sigmoid(i) tanh(g), h = sigmoid(o) tanh(c).
    pub fn lstm(&mut self, gates: &[f32], c: &mut [f32], h: &mut [f32]) {
        assert!(gates.len() == 4 * c.len() && h.len() == c.len(), "lstm: four gates a cell");
        self.kernels.lstm.run(gates, c, h);
    }

    /// y = tanh |a - b|, value by value.
    pub fn tanh_distance(&mut self, a: &[f32], b: &[f32], y: &mut [f32]) {
        assert!(a.len() == y.len() && b.len() == y.len(), "tanh_distance: vectors of one length");
        self.kernels.tanh_distance.run(a, b, y);
    }
}

impl std::fmt::Debug for Exec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Exec({}, {} threads)", self.kernels.level(), self.threads())
    }
}

/// What `head` sees of a ring.
fn seen<'a, T>(cache: &KvCache, k: &'a [T], v: &'a [T], ring: u32, head: usize) -> Head<'a, T> {
    let from = cache.offset(ring as usize, head);
    let at = from..from + cache.capacity * cache.head_dim();
    Head { k: &k[at.clone()], v: &v[at], dim: cache.head_dim(), capacity: cache.capacity }
}
