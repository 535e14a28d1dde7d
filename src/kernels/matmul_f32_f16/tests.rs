use half::f16;

use super::{Job, VARIANTS};
use crate::kernels::packed::{Buffer, FloatGeometry, NR, TILE_COLS, Tile};
use crate::kernels::testing::{Random, available, bits};

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(91);
    for cols in (1..36).chain([64, 127, 260]) {
        for rows in 1..=16 {
            let geo = FloatGeometry::new(cols, 2);
            let mut buffer = Buffer::new(6 * geo.panel * 2);
            let weights = buffer.of_mut::<f16>();
            for r in 0..6 * NR {
                for (c, w) in random.awkward(cols).into_iter().enumerate() {
                    weights[geo.at(r, c)] = f16::from_f32(w);
                }
            }
            let (first, panels) = (random.below(3), 1 + random.below(4));
            let panels = panels.min(6 - first);
            let stride = geo.padded() + random.below(2) * 16;
            let x = random.floats(rows * stride + 1, 2.0);
            let job = Job { x: &x[1..], stride, rows, weights, geo, first, panels };
            let run = |v: &crate::kernels::Variant<super::Run>| {
                let mut tile: Tile<f32> = [[7.0; TILE_COLS]; 16];
                // SAFETY: `available` yields only what this CPU can run.
                unsafe { (v.run)(&job, &mut tile) };
                tile[..rows].iter().map(|r| bits(&r[..panels * NR])).collect::<Vec<_>>()
            };
            let want = run(&VARIANTS[0]);
            for v in available(VARIANTS) {
                assert!(run(v) == want, "{} {rows} x {cols}, {panels} panels", v.name);
            }
        }
    }
}

#[test]
fn products_of_small_integers_are_exact() {
    let geo = FloatGeometry::new(37, 2);
    let mut buffer = Buffer::new(2 * geo.panel * 2);
    let weights = buffer.of_mut::<f16>();
    for r in 0..2 * NR {
        for c in 0..37 {
            weights[geo.at(r, c)] = f16::from_f32(((r * 31 + c * 17) % 11) as f32 - 5.0);
        }
    }
    let mut x = vec![0.0; 3 * geo.padded()];
    for (r, x) in x.chunks_exact_mut(geo.padded()).enumerate() {
        (0..37).for_each(|c| x[c] = ((r * 7 + c * 5) % 13) as f32 - 6.0);
    }
    for v in available(VARIANTS) {
        let mut tile: Tile<f32> = [[7.0; TILE_COLS]; 16];
        // SAFETY: `available` yields only what this CPU can run.
        unsafe { (v.run)(&Job { x: &x, stride: geo.padded(), rows: 3, weights, geo, first: 0, panels: 2 }, &mut tile) };
        for r in 0..3 {
            for c in 0..2 * NR {
                let want: f32 = (0..37).map(|k| x[r * geo.padded() + k] * weights[geo.at(c, k)].to_f32()).sum();
                assert_eq!(tile[r][c], want, "{} ({r},{c})", v.name);
            }
        }
    }
}
