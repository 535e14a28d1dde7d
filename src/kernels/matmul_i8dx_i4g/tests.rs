use half::f16;

use super::{GROUP, Geometry, Job, MatmulI8I4};
use crate::kernels::operation::Kernel;
use crate::kernels::packed::{Buffer, NR, Panels, PrefetchTarget, TILE_COLS, Tile};
use crate::kernels::quantize_rows::Int8Rows;
use crate::kernels::testing::{Random, Results, bits};

/// Runs a variant: values as of plain loops in f64.
fn compare(
    kernel: Kernel<MatmulI8I4>,
    random: &mut Random,
    rows: usize,
    cols: usize,
    nibble: impl Fn(&mut Random) -> u8,
    x: impl Fn(&mut Random) -> i8,
    results: &mut Results,
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
    let count = (1 + random.below(4)).min(6 - first);
    let x = Int8Rows { q, wide: &[], sums: &sums, stride, rows };
    let panels = Panels { first, count, next: PrefetchTarget::new(weights, 0, 0) };
    let mut tile: Tile<f32> = [[7.0; TILE_COLS]; 16];
    kernel.run(&Job { x, weights, scales, geo, panels }, &mut tile);
    let columns = |row: &[f32; TILE_COLS]| row[..count * NR].to_vec();
    for (r, row) in tile[..rows].iter().map(columns).enumerate() {
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
    let bits = tile[..rows].iter().flat_map(|row| bits(&row[..count * NR]));
    results.add(format_args!("{rows} x {cols}, {count} panels"), bits);
}

pub(super) fn cases(kernel: Kernel<MatmulI8I4>, results: &mut Results) {
    let mut random = Random(111);
    for cols in (1..70).step_by(5).chain([96, 128, 288]) {
        for rows in 1..=16 {
            let (nibble, x) = (|r: &mut Random| r.bits() as u8, |r: &mut Random| (r.bits() as i8).max(-127));
            compare(kernel, &mut random, rows, cols, nibble, x, results);
        }
    }
    // Extremes, which must not saturate.
    for cols in [32, 1024] {
        for nibble in [0, 8, 15] {
            for x in [-127i8, 127] {
                compare(kernel, &mut random, 4, cols, |_| nibble, |_| x, results);
            }
        }
    }
}
