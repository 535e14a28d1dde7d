//! C = A B of float matrices in f64, rounded once: two linear layers become one when a bundle is
//! loaded.
//!
//! c\[r\]\[j\] = f32(sum_k a\[r\]\[k\] b\[k\]\[j\]), k ascending from 0. A product of two floats is
//! exact in f64, so a fused multiply-add gives the bits of a product and a sum, and every variant
//! those of the scalar one. A variant fills `R x COLS` sums from [`Operands`] that the function
//! `fold` has laid out.

use super::Kernels;
use super::operation::{Kernel, operation};

/// Columns of a tile of sums.
const COLS: usize = 8;

/// Rows of `a`, transposed, and a panel of columns of `b`: `[inner][R]` and `[inner][COLS]`.
pub(crate) struct Operands<'a> {
    a: &'a [f64],
    b: &'a [[f64; COLS]],
}

/// Sums of a tile, `[ROWS][COLS]`; those of the rows that a variant does not have stay.
pub(crate) type Sums = [[f64; COLS]; ROWS];
/// Rows of a tile, at most.
const ROWS: usize = 8;

operation! {
    /// Sums of a tile; the variant's `about` is its number of rows, R.
    Fold = "fold", (fn(operands: &Operands<'_>, sums: &mut Sums)), about usize;
    (Scalar => scalar, 4)
    (Avx2 => fused::<4>, 4)
    (Avx512 => fused::<8>, 8)
}

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

fn scalar(o: &Operands<'_>, out: &mut Sums) {
    tile::<4>(o, out, |a, b, sum| a * b + sum);
}

#[allow(dead_code, reason = "for architectures with a variant")]
#[inline(always)]
fn fused<const R: usize>(o: &Operands<'_>, out: &mut Sums) {
    tile::<R>(o, out, f64::mul_add);
}

impl Kernels {
    /// A B, `[rows, cols]`, of `a` `[rows, inner]` whose rows are `stride` apart and `b` `[inner,
    /// cols]`.
    pub(crate) fn fold(&self, a: &[f32], stride: usize, b: &[f32], inner: usize, cols: usize) -> Vec<f32> {
        fold(self.fold, a, stride, b, inner, cols)
    }
}

/// As [`Kernels::fold`].
fn fold(kernel: Kernel<Fold>, a: &[f32], stride: usize, b: &[f32], inner: usize, cols: usize) -> Vec<f32> {
    assert!(inner > 0 && inner <= stride && a.len().is_multiple_of(stride), "fold: rows of a are a stride apart");
    assert!(cols > 0 && b.len() == inner * cols, "fold: b is inner x cols");
    let tile_rows = *kernel.about();
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
            kernel.run(&Operands { a: &a_tile, b }, &mut sums);
            for (out, sums) in out.chunks_exact_mut(cols).zip(&sums) {
                out[panel * COLS..].iter_mut().zip(sums).for_each(|(to, v)| *to = *v as f32);
            }
        }
    }
    out
}

#[cfg(any(test, feature = "kernel-tests"))]
mod tests {
    use super::*;
    use crate::kernels::testing::{Random, Results, bits};

    /// As the formula says, one sum after the other.
    fn plain(a: &[f32], stride: usize, b: &[f32], inner: usize, cols: usize) -> Vec<f32> {
        let sum = |row: &[f32], j: usize| {
            (0..inner).fold(0f64, |sum, k| sum + f64::from(row[k]) * f64::from(b[k * cols + j])) as f32
        };
        a.chunks_exact(stride).flat_map(|row| (0..cols).map(move |j| sum(row, j))).collect()
    }

    pub(super) fn cases(kernel: Kernel<Fold>, results: &mut Results) {
        let mut random = Random(7);
        for (rows, inner, extra, cols) in
            [(1, 1, 0, 1), (3, 5, 2, 7), (8, 16, 0, 8), (17, 33, 11, 26), (64, 64, 100, 64)]
        {
            let stride = inner + extra;
            let (a, b) = (random.awkward(rows * stride), random.awkward(inner * cols));
            let expected = bits(&plain(&a, stride, &b, inner, cols));
            let found = bits(&fold(kernel, &a, stride, &b, inner, cols));
            assert!(found == expected, "{}: {rows} x {inner} x {cols}", kernel.level());
            results.add(format_args!("{rows} x {inner} x {cols}"), found);
        }
    }

    #[test]
    fn products_do_not_round_before_they_are_added() {
        // Subnormal products and sums that cancel: where a fused and a plain operation could
        // differ.
        let a = [f32::MIN_POSITIVE, 1.0 + f32::EPSILON, -1.0, f32::MAX];
        let b = [f32::MIN_POSITIVE, 1.0 + f32::EPSILON, 1.0 + 2.0 * f32::EPSILON, f32::MAX];
        for kernel in Kernel::all() {
            for n in 1..=4 {
                assert_eq!(
                    fold(kernel, &a[..n], n, &b[..n], n, 1),
                    plain(&a[..n], n, &b[..n], n, 1),
                    "{}",
                    kernel.level()
                );
            }
        }
    }
}
