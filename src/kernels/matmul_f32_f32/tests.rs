use super::{Job, MatmulF32F32};
use crate::kernels::f32x16::Stored;
use crate::kernels::operation::Kernel;
use crate::kernels::packed::{Buffer, FloatGeometry, NR, Panels, Plain, PrefetchTarget, TILE_COLS, Tile};
use crate::kernels::testing::{Random, Results, bits};

/// As many panels as a job reads, from `first`.
fn panels(first: usize, count: usize) -> Panels {
    Panels { first, count, next: PrefetchTarget::new(&[], 0, 0) }
}

/// Jobs of all sizes with weights that `from_f32` makes, for `run`.
pub(in crate::kernels) fn for_jobs<W: Plain>(
    seed: u64,
    from_f32: impl Fn(f32) -> W,
    run: impl Fn(&Job<'_, W>, &mut Tile<f32>),
    results: &mut Results,
) {
    let mut random = Random(seed);
    for cols in (1..36).chain([64, 127, 260]) {
        for rows in 1..=16 {
            let geo = FloatGeometry::new(cols, size_of::<W>());
            let mut buffer = Buffer::new(6 * geo.panel * size_of::<W>());
            let weights = buffer.of_mut::<W>();
            for r in 0..6 * NR {
                for (c, w) in random.awkward(cols).into_iter().enumerate() {
                    weights[geo.at(r, c)] = from_f32(w.clamp(-1e6, 1e6));
                }
            }
            let (first, count) = (random.below(3), 1 + random.below(4));
            let count = count.min(6 - first);
            let stride = geo.padded() + random.below(2) * 16;
            let x = random.floats(rows * stride + 1, 2.0);
            let mut tile: Tile<f32> = [[7.0; TILE_COLS]; 16];
            run(&Job { x: &x[1..], stride, rows, weights, geo, panels: panels(first, count) }, &mut tile);
            let bits = tile[..rows].iter().flat_map(|r| bits(&r[..count * NR]));
            results.add(format_args!("{rows} x {cols}, {count} panels"), bits);
        }
    }
}

/// That `run` has the exact products of small integers.
pub(in crate::kernels) fn assert_exact<W: Plain + Stored>(
    from_f32: impl Fn(f32) -> W,
    run: impl Fn(&Job<'_, W>, &mut Tile<f32>),
) {
    let geo = FloatGeometry::new(37, size_of::<W>());
    let mut buffer = Buffer::new(2 * geo.panel * size_of::<W>());
    let weights = buffer.of_mut::<W>();
    for r in 0..2 * NR {
        for c in 0..37 {
            weights[geo.at(r, c)] = from_f32(((r * 31 + c * 17) % 11) as f32 - 5.0);
        }
    }
    let mut x = vec![0.0; 3 * geo.padded()];
    for (r, x) in x.chunks_exact_mut(geo.padded()).enumerate() {
        (0..37).for_each(|c| x[c] = ((r * 7 + c * 5) % 13) as f32 - 6.0);
    }
    let mut tile: Tile<f32> = [[7.0; TILE_COLS]; 16];
    run(&Job { x: &x, stride: geo.padded(), rows: 3, weights, geo, panels: panels(0, 2) }, &mut tile);
    for r in 0..3 {
        for c in 0..2 * NR {
            let want: f32 = (0..37).map(|k| x[r * geo.padded() + k] * weights[geo.at(c, k)].to_f32()).sum();
            assert_eq!(tile[r][c], want, "({r},{c})");
        }
    }
}

pub(super) fn cases(kernel: Kernel<MatmulF32F32>, results: &mut Results) {
    for_jobs(81, |w| w, |job, tile| kernel.run(job, tile), results);
}

#[test]
fn products_of_small_integers_are_exact() {
    for kernel in Kernel::<MatmulF32F32>::all() {
        assert_exact(|w| w, |job, tile| kernel.run(job, tile));
    }
}
