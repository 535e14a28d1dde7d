//! int8 rows times int8 weights: tile\[r\]\[c\] = sum_k q\[r\]\[k\] w\[c\]\[k\], exact in i32.
//!
//! `i8dx`: int8 activations, symmetric, quantised per row when they come ([`quantize_rows`](super::quantize_rows)), in -127..=127.
//! `i8cx`: int8 weights, symmetric, one scale per output channel, in -128..=127. Scales are applied by the [`epilogue`](super::epilogue).
//! Contract of a variant: it fills the first `rows` rows and `16 panels` columns of the tile from a [`Job`] that [`Job::check`] accepts.
//! Sums stay below 2^31 for up to 131,071 columns, also with weights offset to unsigned.

use super::packed::{NR, Onward, Tile};
use super::quantize_rows::GROUP;
use super::{Level, Variant, interleave};

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

/// Order of the bytes of 16 outputs x 4 or 8 columns in packed weights, as a variant wants them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(dead_code, reason = "an architecture uses some of them")]
pub(crate) enum Layout {
    /// Lines of 64 bytes: for each lane 4 consecutive columns.
    Quads,
    /// [`Quads`](Self::Quads) with 128 added to each weight: unsigned. The kernel takes off 128 times the row's sum.
    QuadsOffset,
    /// [`Quads`](Self::Quads) with the columns of a lane in the order 0, 2, 1, 3: even bytes hold columns 0 and 1.
    QuadsPaired,
    /// Pairs of lines: for each lane 8 consecutive columns.
    Octets,
}

/// Where an int8 weight lies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Geometry {
    /// Columns, padded with zeros to whole groups.
    pub(crate) padded: usize,
    /// Bytes of one panel: `16 padded` and one line, which keeps panels in different sets of the first-level cache.
    pub(crate) panel: usize,
    pub(crate) layout: Layout,
}

impl Geometry {
    pub(crate) fn new(cols: usize, layout: Layout) -> Self {
        let padded = cols.next_multiple_of(GROUP);
        Self { padded, panel: NR * padded + 64, layout }
    }

    /// Byte that holds weight (`row`, `col`).
    #[cfg(test)]
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

/// Operands: `rows` in 1..=16 rows of `geo.padded` values, `stride` apart, at `q` (and widened at `wide`, where the variant asks for it), the sums of
/// their groups of 32 at `sums`; `panels` in 1..=4 panels from `first`.
pub(crate) struct Job<'a> {
    pub(crate) q: &'a [i8],
    #[allow(dead_code, reason = "the AVX2 variant alone reads it")]
    pub(crate) wide: &'a [i16],
    pub(crate) sums: &'a [i32],
    /// From one row of q to the next.
    pub(crate) stride: usize,
    pub(crate) rows: usize,
    pub(crate) weights: &'a [u8],
    pub(crate) geo: Geometry,
    pub(crate) first: usize,
    pub(crate) panels: usize,
    #[allow(dead_code, reason = "some variants prefetch")]
    pub(crate) next: Onward,
}

impl Job<'_> {
    /// What every variant relies on.
    pub(crate) fn check(&self) {
        let groups = self.geo.padded / GROUP;
        assert!((1..=16).contains(&self.rows) && (1..=4).contains(&self.panels), "rows 1..=16, panels 1..=4");
        assert!(self.stride >= self.geo.padded && self.q.len() >= self.rows * self.stride, "rows are padded");
        assert!(self.sums.len() >= self.rows * groups, "sums of every group");
        assert!(self.weights.len() >= (self.first + self.panels) * self.geo.panel, "panels exist");
    }
}

/// A variant: its entry (unsafe to call on a CPU without its level), the layout it reads, and whether it reads `wide`.
pub(crate) struct Kernel {
    pub(crate) run: unsafe fn(&Job<'_>, &mut Tile<i32>),
    pub(crate) layout: Layout,
    pub(crate) wide: bool,
}

pub(crate) static VARIANTS: &[Variant<Kernel>] = &[
    Variant {
        name: "scalar",
        level: Level::Scalar,
        run: Kernel { run: scalar::run, layout: Layout::Quads, wide: false },
    },
    #[cfg(target_arch = "x86_64")]
    Variant {
        name: "avx2",
        level: Level::Avx2,
        run: Kernel { run: avx2::run, layout: Layout::QuadsPaired, wide: true },
    },
    #[cfg(target_arch = "x86_64")]
    Variant {
        name: "avxvnni",
        level: Level::AvxVnni,
        run: Kernel { run: avxvnni::run, layout: Layout::QuadsOffset, wide: false },
    },
    #[cfg(target_arch = "x86_64")]
    Variant {
        name: "avx512_vnni",
        level: Level::Avx512,
        run: Kernel { run: avx512::run, layout: Layout::QuadsOffset, wide: false },
    },
    #[cfg(target_arch = "aarch64")]
    Variant { name: "neon", level: Level::Neon, run: Kernel { run: neon::run, layout: Layout::Quads, wide: false } },
    #[cfg(target_arch = "aarch64")]
    Variant {
        name: "dotprod",
        level: Level::Dotprod,
        run: Kernel { run: dotprod::run, layout: Layout::Quads, wide: false },
    },
    #[cfg(target_arch = "aarch64")]
    Variant { name: "i8mm", level: Level::I8mm, run: Kernel { run: i8mm::run, layout: Layout::Octets, wide: false } },
];

#[cfg(test)]
mod tests;
