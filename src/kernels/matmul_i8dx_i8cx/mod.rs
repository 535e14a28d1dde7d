//! int8 rows times int8 weights: tile\[r\]\[c\] = sum_k q\[r\]\[k\] w\[c\]\[k\], exact in i32.
//!
//! `i8dx`: int8 activations, symmetric, quantised per row when they come
//! ([`quantize_rows`](super::quantize_rows)), in -127..=127. `i8cx`: int8 weights, symmetric, one
//! scale per output channel, in -128..=127. Scales are applied by the
//! [`epilogue`](super::epilogue). A variant fills as many rows as there are, and 16 columns per
//! panel, of the tile. Sums stay below 2^31 for up to 131,071 columns, also with weights offset to
//! unsigned.

use super::interleave;
use super::operation::operation;
use super::packed::{NR, Panels, Tile};
use super::quantize_rows::{GROUP, Int8Rows};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod avxvnni;
#[cfg(target_arch = "aarch64")]
pub(crate) mod dotprod;
#[cfg(target_arch = "aarch64")]
pub(crate) mod i8mm;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;
#[cfg(any(test, feature = "kernel-tests"))]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
pub(super) mod wasm;

/// Order of the bytes of 16 outputs x 4 or 8 columns in packed weights, as a variant wants them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(dead_code, reason = "an architecture uses some of them")]
pub(crate) enum Layout {
    /// Lines of 64 bytes: for each lane 4 consecutive columns.
    Quads,
    /// [`Quads`](Self::Quads) with 128 added to each weight: unsigned. The kernel takes off 128
    /// times the row's sum.
    QuadsOffset,
    /// [`Quads`](Self::Quads) with the columns of a lane in the order 0, 2, 1, 3: even bytes hold
    /// columns 0 and 1. The kernel takes activations widened to int16.
    QuadsPaired,
    /// Pairs of lines: for each lane 8 consecutive columns.
    Octets,
}

/// Where an int8 weight lies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Geometry {
    /// Columns, padded with zeros to whole groups.
    pub(crate) padded: usize,
    /// Bytes of one panel: `16 padded` and one line, which keeps panels in different sets of the
    /// first-level cache.
    pub(crate) panel: usize,
    pub(crate) layout: Layout,
}

impl Layout {
    /// Whether the variant reads activations widened to int16.
    pub(crate) fn wide(self) -> bool {
        self == Self::QuadsPaired
    }
}

impl Geometry {
    pub(crate) fn new(cols: usize, layout: Layout) -> Self {
        let padded = cols.next_multiple_of(GROUP);
        Self { padded, panel: NR * padded + 64, layout }
    }

    /// Byte that holds weight (`row`, `col`).
    #[cfg(any(test, feature = "kernel-tests"))]
    pub(crate) fn at(&self, row: usize, col: usize) -> usize {
        let (panel, lane) = (row / NR, row % NR);
        let within = match self.layout {
            Layout::Quads | Layout::QuadsOffset => col / 4 * 64 + lane * 4 + col % 4,
            Layout::QuadsPaired => col / 4 * 64 + lane * 4 + [0, 2, 1, 3][col % 4],
            Layout::Octets => col / 8 * 128 + lane * 8 + col % 8,
        };
        panel * self.panel + within
    }

    /// Writes 16 rows (fewer: the last panel) of `cols` weights into the bytes of one panel.
    pub(crate) fn pack(&self, q: &[i8], cols: usize, panel: &mut [u8]) {
        let (width, flip) = (if self.layout == Layout::Octets { 8 } else { 4 }, self.encode(0));
        if cols < self.padded || q.len() < NR * cols {
            panel.fill(flip);
        }
        let swapped = |k: usize| if self.layout == Layout::QuadsPaired { [0, 2, 1, 3][k] } else { k };
        let done = match self.layout {
            _ if q.len() < NR * cols => 0,
            Layout::Quads => interleave::quads(q, cols, panel, |words| words),
            Layout::QuadsOffset => interleave::quads(q, cols, panel, |words| words ^ 0x8080_8080_8080_8080),
            Layout::QuadsPaired => interleave::quads(q, cols, panel, |words| {
                let [a, b, c, d, e, f, g, h] = words.to_le_bytes();
                u64::from_le_bytes([a, c, b, d, e, g, f, h])
            }),
            Layout::Octets => interleave::octets(q, cols, panel),
        };
        for (lane, row) in q.chunks_exact(cols).enumerate() {
            for (from, to) in row[done..].chunks(width).zip(panel[NR * done..].chunks_exact_mut(NR * width)) {
                let to = &mut to[lane * width..][..width];
                if let (Ok(from), Ok(to)) = (<[i8; 4]>::try_from(from), <&mut [u8; 4]>::try_from(&mut *to)) {
                    *to = std::array::from_fn(|k| from[swapped(k)] as u8 ^ flip);
                } else {
                    from.iter()
                        .enumerate()
                        .for_each(|(k, &v)| to[if width == 4 { swapped(k) } else { k }] = v as u8 ^ flip);
                }
            }
        }
    }

    /// The byte for weight `q`; padding is the byte for 0.
    pub(crate) fn encode(&self, q: i8) -> u8 {
        if self.layout == Layout::QuadsOffset { (q as u8) ^ 0x80 } else { q as u8 }
    }
}

/// Operands.
pub(crate) struct Job<'a> {
    pub(crate) x: Int8Rows<'a>,
    pub(crate) weights: &'a [u8],
    pub(crate) geo: Geometry,
    pub(crate) panels: Panels,
}

impl Job<'_> {
    /// What every variant relies on.
    pub(crate) fn check(&self) {
        self.x.check(self.geo.padded);
        self.panels.check(self.weights.len(), self.geo.panel);
    }
}

operation! {
    /// The product of a [`Job`] that [`Job::check`] accepts, with weights packed in the variant's
    /// [`Layout`].
    MatmulI8I8 = "matmul_i8dx_i8cx", (fn(job: &Job<'_>, tile: &mut Tile<i32>)), about Layout;
    (Scalar => scalar::run, Layout::Quads)
    (Neon => neon::run, Layout::Quads)
    (Dotprod => dotprod::run, Layout::Quads)
    (I8mm => i8mm::run, Layout::Octets)
    (Avx2 => avx2::run, Layout::QuadsPaired)
    (AvxVnni => avxvnni::run, Layout::QuadsOffset)
    (Avx512 => avx512::run, Layout::QuadsOffset)
    (Simd128 => wasm::run, Layout::Quads)
}
