//! [`Exec`]: kernels, threads and scratch of one session; the one object that networks call.

use super::Kernels;
use super::activations::Activations;
use super::attend::{Head, KvCache, MAX_GROUP, Row, Span, Store};
use super::linear::{LINE, by_rows};
use super::packed::{Buffer, MAX_ROWS, Onward};
use super::quantize_rows::GROUP;
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

/// Sizes that scratch is allocated for.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Rows of a call, typically; more are worked through in portions of 16.
    #[cfg_attr(not(feature = "internals"), expect(dead_code))]
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
    pub(super) kernels: Kernels,
    pub(super) pool: Pool,
    pub(super) width: usize,
    pub(super) x: Buffer,
    pub(super) q: Buffer,
    pub(super) wide: Buffer,
    pub(super) sums: Vec<i32>,
    /// Where the linear layer after the next one begins.
    pub(super) upcoming: Option<[Onward; 2]>,
    flush: Option<FlushToZero>,
    pub(super) activations: Option<Activations>,
    /// What each thread has to itself while things are shared out whole.
    pub(super) lanes: Option<Box<[Exec; 2]>>,
}

/// A pointer that the pieces of one run share; each writes a part of its own.
#[derive(Clone, Copy)]
pub(super) struct Shared<T = f32>(pub(super) *mut T);
// SAFETY: pieces that hold it write disjoint ranges, which each use argues.
unsafe impl<T> Sync for Shared<T> {}

impl<T> Shared<T> {
    /// `len` values from `from`.
    ///
    /// # Safety
    /// The range lies in the slice that the pointer came from, and no other reference to it lives meanwhile.
    pub(super) unsafe fn part<'a>(&self, from: usize, len: usize) -> &'a mut [T] {
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
            upcoming: None,
            flush: None,
            activations: None,
            lanes: None,
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

    /// Lets `activations` listen to the linear layers from here on (`None`: nobody) and returns what listened so far.
    #[cfg(feature = "internals")]
    pub fn listen(&mut self, activations: Option<Activations>) -> Option<Activations> {
        std::mem::replace(&mut self.activations, activations)
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
        let (kernels, y) = (&self.kernels, Shared(y.as_mut_ptr()));
        by_rows(&mut self.pool, rows, x.len(), &|r| {
            // SAFETY: row r of y, in one piece.
            let y = unsafe { y.part(r * dim, dim) };
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            unsafe { (kernels.norm.run)(&x[r * dim..][..dim], shift.part(r, 0, dim), scale.part(r, 0, dim), y) }
        });
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
        let (kernels, values, x) = (&self.kernels, x.len(), Shared(x.as_mut_ptr()));
        by_rows(&mut self.pool, rows, values, &|r| {
            let at = r * half..(r + 1) * half;
            // SAFETY: whole heads within row r of x, in one piece.
            let x = unsafe { x.part(r * row_stride, heads * head_dim) };
            // SAFETY: a `Kernels` exists only for a level that this CPU has.
            unsafe { (kernels.rope.run)(x, &cos[at.clone()], &sin[at]) }
        });
    }

    /// Attention: row r of `q` (`row_stride` values, of which the first `cache.dim()` are the heads' queries) over `spans[r]`,
    /// scores divided by sqrt(head_dim), into row r of `y` (`spans.len()` x `cache.dim()`).
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
        let (kernels, y) = (&self.kernels, Shared(y.as_mut_ptr()));
        for start in (0..rows).step_by(MAX_SPANS) {
            let spans = &spans[start..rows.min(start + MAX_SPANS)];
            let (groups, n) = groups(spans);
            // One piece is one head of one group: a group's keys are read once.
            self.pool.run(n * heads, &|piece, _| {
                let (head, group) = (piece % heads, groups[piece / heads].rows());
                let first = group.iter().map(|&i| spans[usize::from(i)].first).min().unwrap_or(0);
                let mut rows: [Row<'_>; MAX_GROUP] = std::array::from_fn(|i| match group.get(i) {
                    Some(&i) => {
                        let (r, span) = (start + usize::from(i), spans[usize::from(i)]);
                        Row {
                            q: &q[r * row_stride + head * head_dim..][..head_dim],
                            // SAFETY: in y, and each row's head is in one piece.
                            y: unsafe { y.part(r * dim + head * head_dim, head_dim) },
                            slot: cache.slot(span.first),
                            len: span.len as usize,
                            shift: (span.first - first) as usize,
                        }
                    }
                    None => Row { q: &[], y: &mut [], slot: 0, len: 0, shift: 0 },
                });
                let (rows, ring) = (&mut rows[..group.len()], spans[usize::from(group[0])].ring);
                // SAFETY: a `Kernels` exists only for a level that this CPU has.
                unsafe {
                    match &cache.store {
                        Store::F16(k, v) => (kernels.attend.run.f16)(&seen(cache, k.of(), v.of(), ring, head), rows),
                        Store::F32(k, v) => (kernels.attend.run.f32)(&seen(cache, k.of(), v.of(), ring, head), rows),
                    }
                }
            });
        }
    }

    /// GELU, tanh form, in place.
    #[cfg(feature = "internals")]
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

/// Spans that are grouped at a time, without allocating.
const MAX_SPANS: usize = 64;

/// Spans of one group begin at most this many tokens apart: what only some of its rows see is read for each of them.
const MAX_SHIFT: u64 = 8;

/// Rows whose spans lie in one ring, near each other.
#[derive(Clone, Copy)]
struct Group {
    rows: [u8; MAX_GROUP],
    len: usize,
}

impl Group {
    /// At least one.
    fn rows(&self) -> &[u8] {
        &self.rows[..self.len]
    }
}

/// Groups that hold each of the spans once, and their number.
fn groups(spans: &[Span]) -> ([Group; MAX_SPANS], usize) {
    let mut groups = [Group { rows: [0; MAX_GROUP], len: 0 }; MAX_SPANS];
    let mut n = 0;
    for (i, span) in spans.iter().enumerate() {
        let near = |group: &Group| {
            group.len < MAX_GROUP
                && group
                    .rows()
                    .iter()
                    .map(|&j| &spans[usize::from(j)])
                    .all(|other| other.ring == span.ring && other.first.abs_diff(span.first) <= MAX_SHIFT)
        };
        let at = groups[..n].iter().position(near).unwrap_or(n);
        n = n.max(at + 1);
        let group = &mut groups[at];
        group.rows[group.len] = i as u8;
        group.len += 1;
    }
    (groups, n)
}

/// What `head` sees of a ring.
fn seen<'a, T>(cache: &KvCache, k: &'a [T], v: &'a [T], ring: u32, head: usize) -> Head<'a, T> {
    let from = cache.head(ring as usize, head);
    let at = from..from + cache.capacity * cache.head_dim();
    Head { k: &k[at.clone()], v: &v[at], dim: cache.head_dim(), capacity: cache.capacity }
}
