//! C = A B of float matrices in f64, rounded once: two linear layers become one when a bundle is loaded.
//!
//! c\[r\]\[j\] = f32(sum_k a\[r\]\[k\] b\[k\]\[j\]), k ascending from 0. A product of two floats is exact in f64, so a fused multiply-add gives the bits of a
//! product and a sum, and every variant those of the first. Contract of a variant: it fills `R x COLS` sums from [`Tile`]s that
//! [`Fold::run`] has laid out.

use super::{Kernels, Level, Variant, pick};

/// Columns of a tile of sums.
const COLS: usize = 8;

/// Rows of `a`, transposed, and a panel of columns of `b`: `[inner][R]` and `[inner][COLS]`.
struct Operands<'a> {
    a: &'a [f64],
    b: &'a [[f64; COLS]],
}

/// Sums of a tile, `[ROWS][COLS]`; those of the rows that a variant does not have stay.
type Sums = [[f64; COLS]; ROWS];
/// Rows of a tile, at most.
const ROWS: usize = 8;

struct Run {
    run: unsafe fn(&Operands<'_>, &mut Sums),
    rows: usize,
}

static VARIANTS: &[Variant<Run>] = &[
    Variant { name: "scalar", level: Level::Scalar, run: Run { run: scalar, rows: 4 } },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx2", level: Level::Avx2, run: Run { run: avx2, rows: 4 } },
    #[cfg(target_arch = "x86_64")]
    Variant { name: "avx512", level: Level::Avx512, run: Run { run: avx512, rows: 8 } },
];

#[inline(always)]
fn tile<const R: usize>(o: &Operands<'_>, out: &mut Sums, add: impl Fn(f64, f64, f64) -> f64) {
    let mut sums = [[0f64; COLS]; R];
    for (a, b) in o.a.as_chunks::<R>().0.iter().zip(o.b) {
        for r in 0..R {
            for j in 0..COLS {
                sums[r][j] = add(a[r], b[j], sums[r][j]);
            }
        }
    }
    out[..R].copy_from_slice(&sums);
}

/// # Safety
/// None is needed; variants are of one type.
unsafe fn scalar(o: &Operands<'_>, out: &mut Sums) {
    tile::<4>(o, out, |a, b, sum| a * b + sum);
}

/// # Safety
/// The CPU has [`Level::Avx2`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
unsafe fn avx2(o: &Operands<'_>, out: &mut Sums) {
    tile::<4>(o, out, f64::mul_add);
}

/// # Safety
/// The CPU has [`Level::Avx512`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
unsafe fn avx512(o: &Operands<'_>, out: &mut Sums) {
    tile::<8>(o, out, f64::mul_add);
}

impl Kernels {
    /// A B, `[rows, cols]`, of `a` `[rows, inner]` whose rows are `stride` apart and `b` `[inner, cols]`.
    pub(crate) fn fold(&self, a: &[f32], stride: usize, b: &[f32], inner: usize, cols: usize) -> Vec<f32> {
        fold(pick(VARIANTS, self.level()), a, stride, b, inner, cols)
    }
}

/// As [`Kernels::fold`]; the variant's level is one that this CPU has.
fn fold(variant: &Variant<Run>, a: &[f32], stride: usize, b: &[f32], inner: usize, cols: usize) -> Vec<f32> {
    assert!(inner > 0 && inner <= stride && a.len().is_multiple_of(stride), "fold: rows of a are a stride apart");
    assert!(cols > 0 && b.len() == inner * cols, "fold: b is inner x cols");
    let Run { run, rows: tile_rows } = variant.run;
    let panels = cols.div_ceil(COLS);
    let mut b_panels = vec![[0f64; COLS]; panels * inner];
    for (k, row) in b.chunks_exact(cols).enumerate() {
        for (panel, part) in row.chunks(COLS).enumerate() {
            b_panels[panel * inner + k].iter_mut().zip(part).for_each(|(to, v)| *to = f64::from(*v));
        }
    }
    let rows = a.len() / stride;
    let mut out = vec![0f32; rows * cols];
    let mut a_tile = vec![0f64; inner * tile_rows];
    for (a, out) in a.chunks(tile_rows * stride).zip(out.chunks_mut(tile_rows * cols)) {
        a_tile.fill(0.0);
        for (r, row) in a.chunks_exact(stride).enumerate() {
            row[..inner].iter().zip(a_tile[r..].iter_mut().step_by(tile_rows)).for_each(|(v, to)| *to = f64::from(*v));
        }
        for (panel, b) in b_panels.chunks_exact(inner).enumerate() {
            let mut sums = [[0.0; COLS]; ROWS];
            // SAFETY: a `Kernels` exists only for a level that this CPU has, and the variant is one that the level includes.
            unsafe { run(&Operands { a: &a_tile, b }, &mut sums) };
            for (out, sums) in out.chunks_exact_mut(cols).zip(&sums) {
                out[panel * COLS..].iter_mut().zip(sums).for_each(|(to, v)| *to = *v as f32);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::testing::{Random, available, bits};

    /// As the formula says, one sum after the other.
    fn plain(a: &[f32], stride: usize, b: &[f32], inner: usize, cols: usize) -> Vec<f32> {
        let sum = |row: &[f32], j: usize| {
            (0..inner).fold(0f64, |sum, k| sum + f64::from(row[k]) * f64::from(b[k * cols + j])) as f32
        };
        a.chunks_exact(stride).flat_map(|row| (0..cols).map(move |j| sum(row, j))).collect()
    }

    #[test]
    fn every_variant_gives_the_bits_of_the_formula() {
        let mut random = Random(7);
        for (rows, inner, extra, cols) in
            [(1, 1, 0, 1), (3, 5, 2, 7), (8, 16, 0, 8), (17, 33, 11, 26), (64, 64, 100, 64)]
        {
            let stride = inner + extra;
            let (a, b) = (random.awkward(rows * stride), random.awkward(inner * cols));
            let expected = bits(&plain(&a, stride, &b, inner, cols));
            for variant in available(VARIANTS) {
                let found = fold(variant, &a, stride, &b, inner, cols);
                assert!(bits(&found) == expected, "{}: {rows} x {inner} x {cols}", variant.name);
            }
        }
    }

    #[test]
    fn products_do_not_round_before_they_are_added() {
        // Subnormal products and sums that cancel: where a fused and a plain operation could differ.
        let a = [f32::MIN_POSITIVE, 1.0 + f32::EPSILON, -1.0, f32::MAX];
        let b = [f32::MIN_POSITIVE, 1.0 + f32::EPSILON, 1.0 + 2.0 * f32::EPSILON, f32::MAX];
        for variant in available(VARIANTS) {
            for n in 1..=4 {
                assert_eq!(
                    fold(variant, &a[..n], n, &b[..n], n, 1),
                    plain(&a[..n], n, &b[..n], n, 1),
                    "{}",
                    variant.name
                );
            }
        }
    }
}
