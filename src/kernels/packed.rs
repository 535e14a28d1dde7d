//! Packed weights: memory and geometry.

use std::fmt;

/// Output features of one panel: the lanes of one AVX-512 register of f32.
pub(crate) const NR: usize = 16;
/// Panels of one kernel call, at most.
pub(crate) const MAX_PANELS: usize = 4;
/// Output columns of one tile: the unit of work that a thread takes.
pub(crate) const TILE_COLS: usize = NR * MAX_PANELS;
/// Rows of one kernel call, at most.
pub(crate) const MAX_ROWS: usize = 16;

/// Rows x columns of results of one kernel call, before bias and epilogue.
pub(crate) type Tile<T> = [[T; TILE_COLS]; MAX_ROWS];

/// One cache line; the unit of packed memory, so that it is 64-byte aligned.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct Line([u8; 64]);

/// Zeroed, 64-byte aligned memory, viewed as bytes, integers or floats.
pub(crate) struct Buffer {
    lines: Vec<Line>,
}

impl Buffer {
    /// At least `bytes` zero bytes.
    pub(crate) fn new(bytes: usize) -> Self {
        Self { lines: vec![Line([0; 64]); bytes.div_ceil(64)] }
    }

    pub(crate) fn bytes(&self) -> usize {
        self.lines.len() * 64
    }

    /// The memory as values of `T`.
    pub(crate) fn of<T: Plain>(&self) -> &[T] {
        // SAFETY: `lines` is `bytes()` initialised bytes aligned to 64, a multiple of `T`'s alignment, and every bit pattern is a `T`.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), self.bytes() / size_of::<T>()) }
    }

    /// The memory as values of `T`, to write.
    pub(crate) fn of_mut<T: Plain>(&mut self) -> &mut [T] {
        // SAFETY: as in `of`, and `&mut self` makes it the only view.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), self.bytes() / size_of::<T>()) }
    }
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer({} bytes)", self.bytes())
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

/// Segments that a panel of floats is cut into along its columns: they are read side by side, each as a stream of its own.
pub(crate) const SEGMENTS: usize = 4;

/// Where a float weight lies: panel p, segment s, column k of the segment, lane l at
/// `p * panel + s * seg_stride + k * NR + l` elements.
///
/// A sum visits column 0 of each segment, then column 1 of each, and so on, into one accumulator a lane.
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
        // An odd number of cache lines between streams keeps them in different sets of the first-level cache.
        let line = 64 / element_bytes;
        let seg_stride = ((seg * NR).div_ceil(line) | 1) * line;
        Self { seg, seg_stride, panel: SEGMENTS * seg_stride }
    }

    /// Values of one padded row of activations.
    pub(crate) fn padded(&self) -> usize {
        SEGMENTS * self.seg
    }

    /// Element that holds weight (`row`, `col`).
    pub(crate) fn at(&self, row: usize, col: usize) -> usize {
        let (s, k) = (col / self.seg, col % self.seg);
        (row / NR) * self.panel + s * self.seg_stride + k * NR + row % NR
    }
}

/// Evaluates `$e` with the constant `$R` the number of rows, 1 to 16.
macro_rules! for_rows {
    ($rows:expr, $R:ident => $e:expr) => {
        for_rows!(@ $rows, $R, $e, 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16)
    };
    (@ $rows:expr, $R:ident, $e:expr, $($n:literal)*) => {
        match $rows {
            $($n => { const $R: usize = $n; $e })*
            _ => unreachable!("rows were checked"),
        }
    };
}
pub(crate) use for_rows;
