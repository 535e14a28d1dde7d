use half::f16;

use super::{GROUP, Geometry, Job, VARIANTS};
use crate::kernels::packed::{Buffer, NR, Onward, TILE_COLS, Tile};
use crate::kernels::testing::{Random, available, bits};

/// Runs every available variant; bits as of the reference, and values as of plain loops in f64.
fn compare(
    random: &mut Random,
    rows: usize,
    cols: usize,
    nibble: impl Fn(&mut Random) -> u8,
    x: impl Fn(&mut Random) -> i8,
) {
    let geo = Geometry::new(cols);
    let padded = geo.padded();
    let stride = padded + 64 * random.below(2);
    let mut q = vec![0i8; rows * stride + 1];
    for r in 0..rows {
        (0..cols).for_each(|c| q[1 + r * stride + c] = x(random));
    }
    let q = &q[1..];
    let sums: Vec<i32> = (0..rows)
        .flat_map(|r| q[r * stride..][..padded].chunks_exact(GROUP))
        .map(|g| g.iter().map(|&v| i32::from(v)).sum())
        .collect();
    let mut buffer = Buffer::new(6 * geo.panel);
    for out in 0..6 * NR {
        for c in 0..padded {
            let (at, high) = geo.at(out, c);
            buffer.of_mut::<u8>()[at] |= (nibble(random) & 15) << if high { 4 } else { 0 };
        }
        for g in 0..geo.groups {
            // Denormal, largest and zero scales among usual ones of both signs.
            let usual = 0.1 * random.unit();
            let scale = [usual, usual, -usual, 6e-8, 65504.0, 0.0][random.below(6)];
            buffer.of_mut::<f16>()[geo.scale_at(out, g)] = f16::from_f32(scale);
        }
    }
    let (weights, scales) = (buffer.of::<u8>(), buffer.of::<f16>());
    let first = random.below(3);
    let panels = (1 + random.below(4)).min(6 - first);
    let job =
        Job { q, sums: &sums, stride, rows, weights, scales, geo, first, panels, next: Onward::new(weights, 0, 0) };
    let run = |v: &crate::kernels::Variant<super::Run>| {
        let mut tile: Tile<f32> = [[7.0; TILE_COLS]; 16];
        // SAFETY: `available` yields only what this CPU can run.
        unsafe { (v.run)(&job, &mut tile) };
        tile[..rows].iter().map(|r| r[..panels * NR].to_vec()).collect::<Vec<_>>()
    };
    let want = run(&VARIANTS[0]);
    for (r, row) in want.iter().enumerate() {
        for (c, &got) in row.iter().enumerate() {
            let out = first * NR + c;
            let (mut sum, mut size) = (0.0f64, 1e-3);
            for k in 0..padded {
                let (at, high) = geo.at(out, k);
                let w = f64::from(if high { weights[at] >> 4 } else { weights[at] & 15 }) - 8.0;
                let term = w * f64::from(q[r * stride + k]) * scales[geo.scale_at(out, k / GROUP)].to_f64();
                sum += term;
                size += term.abs();
            }
            assert!((f64::from(got) - sum).abs() < 1e-6 * size, "({r},{c}): {got} for {sum}");
        }
    }
    for v in available(VARIANTS) {
        for (got, want) in run(v).iter().zip(&want) {
            assert_eq!(bits(got), bits(want), "{} {rows} x {cols}, {panels} panels", v.name);
        }
    }
}

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(111);
    for cols in (1..70).step_by(5).chain([96, 128, 288]) {
        for rows in 1..=16 {
            compare(&mut random, rows, cols, |r| r.bits() as u8, |r| (r.bits() as i8).max(-127));
        }
    }
}

#[test]
fn extremes_do_not_saturate() {
    let mut random = Random(112);
    for cols in [32, 1024] {
        for nibble in [0, 8, 15] {
            for x in [-127i8, 127] {
                compare(&mut random, 4, cols, |_| nibble, |_| x);
            }
        }
    }
}
