use super::{Geometry, Job, Layout, MatmulI8I8};
use crate::kernels::operation::Kernel;
use crate::kernels::packed::{Buffer, NR, Panels, PrefetchTarget, TILE_COLS, Tile};
use crate::kernels::quantize_rows::{GROUP, Int8Rows};
use crate::kernels::testing::{Random, Results};

/// Sums of `rows` rows of q (padded) with weights `w` (6 panels of 16 x cols), by plain loops.
fn naive(q: &[i8], stride: usize, w: &[i8], cols: usize, row: usize, out: usize) -> i32 {
    (0..cols).map(|k| i32::from(q[row * stride + k]) * i32::from(w[out * cols + k])).sum()
}

/// Runs a variant on `rows` x `cols` with weights and activations of the given kind, against plain
/// loops.
fn compare(
    kernel: Kernel<MatmulI8I8>,
    random: &mut Random,
    rows: usize,
    cols: usize,
    w: &[i8],
    x: impl Fn(&mut Random) -> i8,
    results: &mut Results,
) {
    let padded = cols.next_multiple_of(GROUP);
    let stride = padded + 64 * random.below(2);
    let mut q = vec![0i8; rows * stride + 1];
    for r in 0..rows {
        (0..cols).for_each(|c| q[1 + r * stride + c] = x(random));
    }
    let q = &q[1..];
    let wide: Vec<i16> = std::iter::once(0).chain(q.iter().map(|&v| v.into())).collect();
    let sums: Vec<i32> = (0..rows)
        .flat_map(|r| q[r * stride..][..padded].chunks_exact(GROUP))
        .map(|g| g.iter().map(|&v| i32::from(v)).sum())
        .collect();
    let first = random.below(3);
    let count = (1 + random.below(4)).min(6 - first);
    let (level, layout) = (kernel.level(), *kernel.about());
    let geo = Geometry::new(cols, layout);
    let mut buffer = Buffer::new(6 * geo.panel);
    let weights = buffer.of_mut::<u8>();
    weights.fill(geo.encode(0));
    for (i, &w) in w.iter().enumerate() {
        weights[geo.at(i / cols, i % cols)] = geo.encode(w);
    }
    let mut packed = vec![0; geo.panel];
    for (p, w) in w.chunks(NR * cols).enumerate() {
        geo.pack(w, cols, &mut packed);
        assert_eq!(packed[..NR * padded], weights[p * geo.panel..][..NR * padded], "{level} {cols}");
    }
    let wide = if layout.wide() { &wide[1..] } else { &[] };
    let x = Int8Rows { q, wide, sums: &sums, stride, rows };
    let panels = Panels { first, count, next: PrefetchTarget::new(weights, 0, 0) };
    let mut tile: Tile<i32> = [[7; TILE_COLS]; 16];
    kernel.run(&Job { x, weights, geo, panels }, &mut tile);
    for (r, row) in tile[..rows].iter().enumerate() {
        for (c, &got) in row[..count * NR].iter().enumerate() {
            let want = naive(q, stride, w, cols, r, first * NR + c);
            assert_eq!(got, want, "{level} {rows} x {cols}, {count} panels at ({r},{c})");
        }
    }
    let sums = tile[..rows].iter().flat_map(|row| &row[..count * NR]);
    results.add(format_args!("{rows} x {cols}, {count} panels"), sums.map(|&v| v as u32));
}

pub(super) fn cases(kernel: Kernel<MatmulI8I8>, results: &mut Results) {
    let mut random = Random(101);
    for cols in (1..70).step_by(3).chain([96, 128, 160, 288]) {
        for rows in 1..=16 {
            let w = random.bytes(6 * NR * cols);
            compare(kernel, &mut random, rows, cols, &w, |r| (r.bits() as i8).max(-127), results);
        }
    }
    // Extremes, which must not saturate.
    for cols in [32, 100, 4096] {
        for rows in [1, 4, 5, 16] {
            for w in [-128i8, 127] {
                let w = vec![w; 6 * NR * cols];
                for x in [-127i8, 127, 0] {
                    compare(kernel, &mut random, rows, cols, &w, |_| x, results);
                }
                let either = |r: &mut Random| if r.below(2) == 0 { -127 } else { 127 };
                compare(kernel, &mut random, rows, cols, &w, either, results);
            }
        }
    }
}

#[test]
fn every_layout_has_a_place_for_every_weight() {
    let mut random = Random(77);
    for layout in [Layout::Quads, Layout::QuadsOffset, Layout::QuadsPaired, Layout::Octets] {
        for (rows, cols) in [(16, 1), (16, 16), (16, 47), (16, 64), (16, 200), (5, 64), (13, 33)] {
            let (geo, w) = (Geometry::new(cols, layout), random.bytes(rows * cols));
            let mut expected = vec![geo.encode(0); geo.panel];
            w.iter().enumerate().for_each(|(i, w)| expected[geo.at(i / cols, i % cols)] = geo.encode(*w));
            let mut packed = vec![7; geo.panel];
            geo.pack(&w, cols, &mut packed);
            let n = NR * geo.padded;
            assert_eq!(packed[..n], expected[..n], "{layout:?} {rows} x {cols}");
        }
    }
}
