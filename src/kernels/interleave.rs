//! Sixteen rows of bytes to panels, in which a few consecutive columns of each row lie side by
//! side: the inner loops of packing.
//!
//! Plain copies of words, two at a time; a panel stays in the first-level cache while it is filled.

use super::packed::NR;

/// Rows whose words are turned over together.
const GROUP: usize = 4;
/// The first of two words.
const LOW: u64 = u32::MAX as u64;
/// Columns that are read at once: a cache line of each row.
const COLS: usize = 64;

/// Columns `0 .. n` of 16 rows of `cols` bytes as lines of 4 columns per row, each pair of words
/// through `map`; returns n, a multiple of 16. The line of columns `4 i ..` begins at byte `64 i`
/// of `panel`.
#[inline(always)]
pub(super) fn quads(rows: &[i8], cols: usize, panel: &mut [u8], map: impl Fn(u64) -> u64) -> usize {
    let done = cols / 16 * 16;
    for from in (0..done).step_by(COLS) {
        let to = done.min(from + COLS);
        for (g, rows) in rows.chunks_exact(GROUP * cols).enumerate().take(NR / GROUP) {
            let row = |r: usize| rows[r * cols + from..r * cols + to].as_chunks::<16>().0;
            let four = row(0).iter().zip(row(1)).zip(row(2)).zip(row(3));
            let lines = panel[NR * from..NR * to].as_chunks_mut::<256>().0;
            for ((((a, b), c), d), lines) in four.zip(lines) {
                for (i, lines) in lines.as_chunks_mut::<128>().0.iter_mut().enumerate() {
                    let [a, b, c, d] =
                        [a, b, c, d].map(|bytes| u64::from_le_bytes(bytes.as_chunks::<8>().0[i].map(|v| v as u8)));
                    let first = |x: u64, y: u64| map(x & LOW | y << 32).to_le_bytes();
                    let second = |x: u64, y: u64| map(x >> 32 | y & !LOW).to_le_bytes();
                    let (lines, _) = lines.as_chunks_mut::<64>();
                    for (line, [ab, cd]) in
                        lines.iter_mut().zip([[first(a, b), first(c, d)], [second(a, b), second(c, d)]])
                    {
                        let (parts, _) = line[16 * g..16 * g + 16].as_chunks_mut::<8>();
                        (parts[0], parts[1]) = (ab, cd);
                    }
                }
            }
        }
    }
    done
}

/// Columns `0 .. n` of 16 rows of `cols` bytes as pairs of lines, 8 columns per row; returns n, a
/// multiple of 16. The lines of columns `8 i ..` begin at byte `128 i` of `panel`.
pub(super) fn octets(rows: &[i8], cols: usize, panel: &mut [u8]) -> usize {
    let done = cols / 16 * 16;
    for from in (0..done).step_by(COLS) {
        let to = done.min(from + COLS);
        for (g, rows) in rows.chunks_exact(2 * cols).enumerate().take(NR / 2) {
            let row = |r: usize| rows[r * cols + from..r * cols + to].as_chunks::<8>().0;
            let lines = panel[NR * from..NR * to].as_chunks_mut::<128>().0;
            for ((a, b), line) in row(0).iter().zip(row(1)).zip(lines) {
                let (part, _) = line[16 * g..16 * g + 16].as_chunks_mut::<8>();
                (part[0], part[1]) = (a.map(|v| v as u8), b.map(|v| v as u8));
            }
        }
    }
    done
}
