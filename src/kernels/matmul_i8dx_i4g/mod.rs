//! int8 rows times int4 weights in groups of 32 columns: tile\[r\]\[c\] = sum_g s\[c\]\[g\] (sum_{k
//! in g} q\[r\]\[k\] (n\[c\]\[k\] - 8)).
//!
//! Nibbles n in 0..=15 stand for -8..=7; a group's scale is an f16. The inner sums are exact; the
//! outer sum visits the groups in ascending order, one fused multiply-add each, from zero. The
//! row's scale is applied by the [`epilogue`](super::epilogue).
//!
//! Packed panel: for each pair of groups nine lines of 64 bytes, read one after the other: four a
//! group, line j holding for each of 16 lanes 4 bytes, byte i with column 8j + i in the low nibble
//! and 8j + 4 + i in the high one, and one with the 16 f16 scales of both groups.

use half::f16;

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
mod dotprod;
#[cfg(target_arch = "aarch64")]
mod i8mm;
#[cfg(target_arch = "aarch64")]
mod neon;
mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

/// Where an int4 weight and its scale lie.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Geometry {
    pub(crate) groups: usize,
    /// Bytes of one panel, an odd number of lines.
    pub(crate) panel: usize,
}

/// Bytes of the nibbles of one group of one panel.
pub(crate) const GROUP_BYTES: usize = GROUP * NR / 2;

/// Bytes of a pair of groups with their scales.
const PAIR_BYTES: usize = 2 * GROUP_BYTES + 4 * NR;

impl Geometry {
    pub(crate) fn new(cols: usize) -> Self {
        let groups = cols.div_ceil(GROUP);
        Self { groups, panel: ((groups.div_ceil(2) * PAIR_BYTES / 64) | 1) * 64 }
    }

    /// First byte of the nibbles of group `group` within a panel.
    #[inline(always)]
    pub(crate) fn nibbles(group: usize) -> usize {
        group / 2 * PAIR_BYTES + group % 2 * GROUP_BYTES
    }

    /// First f16 element of the scales of group `group` within a panel.
    #[inline(always)]
    pub(crate) fn scales(group: usize) -> usize {
        (group / 2 * PAIR_BYTES + 2 * GROUP_BYTES) / 2 + group % 2 * NR
    }

    /// Writes 16 rows (fewer: the last panel) of `cols` nibbles, two a byte, into the bytes of one
    /// panel, which are zero.
    pub(crate) fn pack(q: &[u8], cols: usize, panel: &mut [u8]) {
        for (lane, row) in q.chunks_exact(cols.div_ceil(2)).enumerate() {
            for (i, from) in row.chunks(4).enumerate() {
                let mut bytes = [0; 4];
                bytes[..from.len()].copy_from_slice(from);
                // Nothing past the last column.
                let eight = u32::from_le_bytes(bytes) & u32::MAX >> (32 - 4 * (cols - 8 * i).min(8));
                let line = panel[Self::nibbles(i / 4) + i % 4 * 64..][..64].as_chunks_mut::<4>().0;
                line[lane] = (spread(eight & 0xffff) | spread(eight >> 16) << 4).to_le_bytes();
            }
        }
    }

    pub(crate) fn padded(&self) -> usize {
        self.groups * GROUP
    }

    /// Byte that holds weight (`row`, `col`), and whether in its high nibble.
    #[cfg(test)]
    pub(crate) fn at(&self, row: usize, col: usize) -> (usize, bool) {
        let byte = (row / NR) * self.panel + Self::nibbles(col / GROUP) + col % GROUP / 8 * 64 + row % NR * 4 + col % 4;
        (byte, col % 8 >= 4)
    }

    /// f16 element that holds the scale of group `group` of `row`.
    pub(crate) fn scale_at(&self, row: usize, group: usize) -> usize {
        (row / NR) * self.panel / 2 + Self::scales(group) + row % NR
    }
}

/// Four nibbles, one a byte.
fn spread(nibbles: u32) -> u32 {
    let bytes = (nibbles | nibbles << 8) & 0x00ff_00ff;
    (bytes | bytes << 4) & 0x0f0f_0f0f
}

/// Operands; `scales` is the same memory as `weights`.
pub(crate) struct Job<'a> {
    pub(crate) x: Int8Rows<'a>,
    pub(crate) weights: &'a [u8],
    pub(crate) scales: &'a [f16],
    pub(crate) geo: Geometry,
    pub(crate) panels: Panels,
}

impl Job<'_> {
    /// What every variant relies on.
    pub(crate) fn check(&self) {
        self.x.check(self.geo.padded());
        self.panels.check(self.weights.len(), self.geo.panel);
        assert!(self.scales.len() == self.weights.len() / 2, "scales are the memory of the weights");
    }
}

operation! {
    /// The product of a [`Job`] that [`Job::check`] accepts.
    MatmulI8I4 = "matmul_i8dx_i4g", (fn(job: &Job<'_>, tile: &mut Tile<f32>));
    (Scalar => scalar::run)
    (Neon => neon::run)
    (Dotprod => dotprod::run)
    (I8mm => i8mm::run)
    (Avx2 => avx2::run)
    (AvxVnni => avxvnni::run)
    (Avx512 => avx512::run)
    (Simd128, Relaxed => wasm::run, token)
}
