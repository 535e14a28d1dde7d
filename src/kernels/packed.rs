//! Packed weights: memory and geometry.

use std::fmt;
use std::ops::Range;

#[cfg(target_os = "linux")]
use memmap2::MmapMut;

/// Output features of one panel: the lanes of one AVX-512 register of f32.
pub(crate) const NR: usize = 16;
/// Panels of one kernel call, at most.
pub(crate) const MAX_PANELS: usize = 4;
/// Output columns of one tile: the unit of work that a thread takes.
pub(crate) const TILE_COLS: usize = NR * MAX_PANELS;
/// Rows of one kernel call, at most.
pub(crate) const MAX_ROWS: usize = 16;

/// Where a thread probably reads on after a tile: a hint for prefetching, which need not be memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PrefetchTarget {
    at: usize,
    /// Bytes from one panel to the next.
    panel: usize,
}

impl PrefetchTarget {
    /// At tiles of weights that begin `at`.
    pub(crate) fn new(weights: &[u8], at: usize, panel: usize) -> Self {
        Self { at: weights.as_ptr().addr().wrapping_add(at), panel }
    }

    /// Byte `at` of panel `p` from there.
    #[allow(dead_code, reason = "some levels prefetch")]
    #[inline(always)]
    pub(crate) fn byte(&self, p: usize, at: isize) -> *const u8 {
        std::ptr::without_provenance(self.at.wrapping_add(p * self.panel).wrapping_add_signed(at))
    }
}

/// The panels of weights that one kernel call reads.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Panels {
    pub(crate) first: usize,
    /// 1 to 4.
    pub(crate) count: usize,
    /// What is read after them.
    #[allow(dead_code, reason = "some levels prefetch")]
    pub(crate) next: PrefetchTarget,
}

impl Panels {
    /// What every variant relies on: that there are so many panels of `size` values in `len`.
    pub(crate) fn check(&self, len: usize, size: usize) {
        assert!((1..=MAX_PANELS).contains(&self.count), "panels 1..=4");
        assert!(len >= (self.first + self.count) * size, "panels exist");
    }
}

/// Rows x columns of results of one kernel call, before bias and epilogue.
pub(crate) type Tile<T> = [[T; TILE_COLS]; MAX_ROWS];

/// One cache line.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct Line([u8; 64]);

/// Page size that large buffers ask the system for: fewer address translations while weights stream
/// by.
#[cfg(any(test, target_os = "linux"))]
const HUGE: usize = 2 << 20;

/// Zeroed, 64-byte aligned memory, viewed as bytes, integers or floats.
pub(crate) struct Buffer {
    store: Store,
    bytes: usize,
}

enum Store {
    Lines(Vec<Line>),
    /// A mapping, and where in it the buffer begins: large ones at a multiple of [`HUGE`].
    #[cfg(target_os = "linux")]
    Pages(MmapMut, usize),
}

/// Smallest buffer in pages of its own, bytes. Weights that live long do not lie between what
/// loading took and gave back, so an allocator can return that.
#[cfg(any(test, target_os = "linux"))]
const OWN_PAGES: usize = 1 << 16;

impl Buffer {
    /// At least `bytes` zero bytes.
    pub(crate) fn new(bytes: usize) -> Self {
        let bytes = bytes.next_multiple_of(64);
        let store = Self::pages(bytes).unwrap_or_else(|| Store::Lines(vec![Line([0; 64]); bytes / 64]));
        Self { store, bytes }
    }

    /// Buffers in pages of their own: huge ones, as far as they fill them; the system may decline,
    /// which costs speed alone.
    #[cfg(target_os = "linux")]
    fn pages(bytes: usize) -> Option<Store> {
        if bytes < OWN_PAGES {
            return None;
        }
        if bytes < HUGE {
            return Some(Store::Pages(MmapMut::map_anon(bytes).ok()?, 0));
        }
        let map = MmapMut::map_anon(bytes + HUGE).ok()?;
        let from = map.as_ptr().align_offset(HUGE);
        let _ = map.advise_range(memmap2::Advice::HugePage, from, bytes / HUGE * HUGE);
        (from <= HUGE).then_some(Store::Pages(map, from))
    }

    /// A mapping has nothing over the allocator.
    #[cfg(not(target_os = "linux"))]
    fn pages(_bytes: usize) -> Option<Store> {
        None
    }

    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    fn start(&self) -> *const u8 {
        match &self.store {
            Store::Lines(lines) => lines.as_ptr().cast(),
            #[cfg(target_os = "linux")]
            Store::Pages(map, from) => map[*from..].as_ptr(),
        }
    }

    /// The memory as values of `T`.
    pub(crate) fn of<T: Plain>(&self) -> &[T] {
        // SAFETY: `start` is `bytes` initialised bytes aligned to 64, a multiple of `T`'s
        // alignment, and every bit pattern is a `T`.
        unsafe { std::slice::from_raw_parts(self.start().cast(), self.bytes / size_of::<T>()) }
    }

    /// The memory as values of `T`, to write.
    pub(crate) fn of_mut<T: Plain>(&mut self) -> &mut [T] {
        let start: *mut u8 = match &mut self.store {
            Store::Lines(lines) => lines.as_mut_ptr().cast(),
            #[cfg(target_os = "linux")]
            Store::Pages(map, from) => map[*from..].as_mut_ptr(),
        };
        // SAFETY: as in `of`, and `&mut self` makes it the only view.
        unsafe { std::slice::from_raw_parts_mut(start.cast(), self.bytes / size_of::<T>()) }
    }
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer({} bytes)", self.bytes)
    }
}

/// A type without padding for which every bit pattern is valid, of size and alignment at most 8.
///
/// # Safety
/// Only such types implement it.
pub(crate) unsafe trait Plain: Copy {}
// SAFETY: plain numbers.
unsafe impl Plain for u8 {}
// SAFETY: plain numbers.
unsafe impl Plain for i8 {}
// SAFETY: plain numbers.
unsafe impl Plain for i16 {}
// SAFETY: plain numbers.
unsafe impl Plain for f32 {}
// SAFETY: `half::f16` is a transparent u16.
unsafe impl Plain for half::f16 {}

/// Segments that a panel of floats is cut into along its columns: they are read side by side, each
/// as a stream of its own.
pub(crate) const SEGMENTS: usize = 4;

/// Where a float weight lies: panel p, segment s, column k of the segment, lane l at
/// `p * panel + s * seg_stride + k * NR + l` elements.
///
/// A sum visits column 0 of each segment, then column 1 of each, and so on, into one accumulator a
/// lane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FloatGeometry {
    /// Columns of a segment; a row of activations is padded with zeros to `SEGMENTS * seg` values.
    pub(crate) seg: usize,
    pub(crate) seg_stride: usize,
    pub(crate) panel: usize,
}

impl FloatGeometry {
    pub(crate) fn new(cols: usize, element_bytes: usize) -> Self {
        let seg = cols.div_ceil(SEGMENTS);
        // An odd number of cache lines between streams keeps them in different sets of the
        // first-level cache.
        let line = 64 / element_bytes;
        let seg_stride = ((seg * NR).div_ceil(line) | 1) * line;
        Self { seg, seg_stride, panel: SEGMENTS * seg_stride }
    }

    /// Values of one padded row of activations.
    pub(crate) fn padded(&self) -> usize {
        SEGMENTS * self.seg
    }

    /// Element that holds weight (`row`, `col`).
    #[cfg(test)]
    pub(crate) fn at(&self, row: usize, col: usize) -> usize {
        let (s, k) = (col / self.seg, col % self.seg);
        (row / NR) * self.panel + s * self.seg_stride + k * NR + row % NR
    }
}

/// Evaluates `$e` with the constant `$R` the number of rows, one of those listed.
macro_rules! for_rows {
    ($rows:expr, $R:ident in [$($n:literal)*] => $e:expr) => {
        match $rows {
            $($n => { const $R: usize = $n; $e })*
            _ => unreachable!("rows were checked"),
        }
    };
}

/// Covers the range `$rows` and the first `$panels` panels with blocks of R rows and P panels:
/// evaluates `$block` for each, with the constants `$R` and `$P` and the first row `$r` and panel
/// `$p`.
///
/// Rows go in even [portions] of at most the largest R listed; as many panels at once, of the
/// numbers listed from the largest down to 1, as R P accumulators fit `$room`. All rows of some
/// panels come before the next panels.
macro_rules! for_blocks {
    ($rows:expr, $panels:expr, $room:expr, $R:ident in [$($n:literal)*], $P:ident in [$($m:literal)*],
     |$r:ident, $p:ident| $block:expr) => {{
        let (rows, panels): (std::ops::Range<usize>, usize) = ($rows, $panels);
        let most = [$($n),*].into_iter().fold(1, usize::max).min($room);
        let tallest = rows.len().min(most);
        let mut $p = 0;
        while $p < panels {
            let wide = [$($m),*].into_iter().find(|m| m * tallest <= $room && $p + m <= panels).unwrap_or(1);
            for portion in $crate::kernels::packed::portions(rows.clone(), most) {
                let $r = portion.start;
                $crate::kernels::packed::for_rows!(portion.len(), $R in [$($n)*] => match wide {
                    $($m => {
                        const $P: usize = $m;
                        if $R * $P <= $room {
                            $block
                        }
                    })*
                    _ => unreachable!("one of those listed"),
                });
            }
            $p += wide;
        }
    }};
}
pub(crate) use {for_blocks, for_rows};

/// `rows` in as few parts of at most `most` rows as will do, as equal as they can be; the first is
/// the largest.
#[inline(always)]
pub(crate) fn portions(rows: Range<usize>, most: usize) -> impl Iterator<Item = Range<usize>> {
    let portion = rows.len().div_ceil(rows.len().div_ceil(most).max(1)).max(1);
    rows.clone().step_by(portion).map(move |from| from..rows.end.min(from + portion))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_zeroed_and_aligned() {
        for bytes in [0, 1, 64, 1000, OWN_PAGES - 64, OWN_PAGES, HUGE - 64, HUGE, 3 * HUGE + 100] {
            let mut buffer = Buffer::new(bytes);
            assert!(buffer.bytes() >= bytes && buffer.bytes() < bytes + 64, "{buffer:?}");
            assert!(buffer.of::<u8>().iter().all(|&b| b == 0));
            assert!((buffer.of::<f32>().as_ptr() as usize).is_multiple_of(64));
            if let Some(last) = buffer.of_mut::<i16>().last_mut() {
                *last = -1;
                assert_eq!(buffer.of::<u8>()[buffer.bytes() - 1], 255);
            }
        }
    }

    #[test]
    fn blocks_cover_every_row_of_every_panel_once() {
        for (rows, panels) in (0..=16).flat_map(|rows| (1..=MAX_PANELS).map(move |panels| (rows, panels))) {
            for room in [1, 3, 6, 16, 24] {
                let mut seen = [[0; MAX_PANELS]; MAX_ROWS];
                let mut block = |r: usize, p: usize, rows: usize, panels: usize| {
                    seen[r..r + rows].iter_mut().for_each(|row| row[p..p + panels].iter_mut().for_each(|n| *n += 1));
                };
                for_blocks!(0..rows, panels, room, R in [1 2 3 4 5 6], P in [4 2 1], |r, p| block(r, p, R, P));
                let once = |row: &[i32; MAX_PANELS]| row[..panels].iter().all(|&n| n == 1);
                assert!(seen[..rows].iter().all(once), "{rows} x {panels}, room {room}: {seen:?}");
                let total = seen.as_flattened().iter().sum::<i32>();
                assert_eq!(total as usize, rows * panels, "nothing else: {seen:?}");
            }
        }
        let sizes = |rows: usize, most| portions(3..3 + rows, most).map(|p| p.len()).collect::<Vec<_>>();
        assert_eq!((sizes(16, 6), sizes(7, 6), sizes(5, 8)), (vec![6, 6, 4], vec![4, 3], vec![5]));
    }

    #[test]
    fn every_float_weight_has_a_place_of_its_own() {
        for cols in [1, 3, 4, 17, 64] {
            let geo = FloatGeometry::new(cols, 2);
            let mut seen = vec![false; 3 * geo.panel];
            for (r, c) in (0..3 * NR).flat_map(|r| (0..cols).map(move |c| (r, c))) {
                assert!(!std::mem::replace(&mut seen[geo.at(r, c)], true));
            }
        }
    }
}
