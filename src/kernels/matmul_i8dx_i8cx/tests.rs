use super::{Geometry, Job, Layout, VARIANTS};
use crate::kernels::packed::{Buffer, NR, Onward, TILE_COLS, Tile};
use crate::kernels::quantize_rows::GROUP;
use crate::kernels::testing::{Random, available};

/// Sums of `rows` rows of q (padded) with weights `w` (6 panels of 16 x cols), by plain loops.
fn naive(q: &[i8], stride: usize, w: &[i8], cols: usize, row: usize, out: usize) -> i32 {
    (0..cols).map(|k| i32::from(q[row * stride + k]) * i32::from(w[out * cols + k])).sum()
}

/// Runs every available variant on `rows` x `cols` with weights and activations of the given kind, against plain loops.
fn compare(random: &mut Random, rows: usize, cols: usize, w: &[i8], x: impl Fn(&mut Random) -> i8) {
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
    let panels = (1 + random.below(4)).min(6 - first);
    for v in available(VARIANTS) {
        let geo = Geometry::new(cols, v.run.layout);
        let mut buffer = Buffer::new(6 * geo.panel);
        let weights = buffer.of_mut::<u8>();
        weights.fill(geo.encode(0));
        for (i, &w) in w.iter().enumerate() {
            weights[geo.at(i / cols, i % cols)] = geo.encode(w);
        }
        let mut packed = vec![0; geo.panel];
        for (p, w) in w.chunks(NR * cols).enumerate() {
            geo.pack(w, cols, &mut packed);
            assert_eq!(packed[..NR * padded], weights[p * geo.panel..][..NR * padded], "{} {cols}", v.name);
        }
        let wide = if v.run.wide { &wide[1..] } else { &[] };
        let job =
            Job { q, wide, sums: &sums, stride, rows, weights, geo, first, panels, next: Onward::new(weights, 0, 0) };
        let mut tile: Tile<i32> = [[7; TILE_COLS]; 16];
        // SAFETY: `available` yields only what this CPU can run.
        unsafe { (v.run.run)(&job, &mut tile) };
        for (r, row) in tile[..rows].iter().enumerate() {
            for (c, &got) in row[..panels * NR].iter().enumerate() {
                let want = naive(q, stride, w, cols, r, first * NR + c);
                assert_eq!(got, want, "{} {rows} x {cols}, {panels} panels at ({r},{c})", v.name);
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

#[test]
fn sums_are_exact() {
    let mut random = Random(101);
    for cols in (1..70).step_by(3).chain([96, 128, 160, 288]) {
        for rows in 1..=16 {
            let w = random.bytes(6 * NR * cols);
            compare(&mut random, rows, cols, &w, |r| (r.bits() as i8).max(-127));
        }
    }
}

#[test]
fn extremes_do_not_saturate() {
    let mut random = Random(102);
    for cols in [32, 100, 4096] {
        for rows in [1, 4, 5, 16] {
            for w in [-128i8, 127] {
                let w = vec![w; 6 * NR * cols];
                for x in [-127i8, 127, 0] {
                    compare(&mut random, rows, cols, &w, |_| x);
                }
                compare(&mut random, rows, cols, &w, |r| if r.below(2) == 0 { -127 } else { 127 });
            }
        }
    }
}
