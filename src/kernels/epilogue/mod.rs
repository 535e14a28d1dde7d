//! What follows a product: scaling, bias, and the activation or the addition to the residual
//! stream.
//!
//! For each column c: t = sum\[c\] x_scale, or sum\[c\] (x_scale w_scale\[c\]) of integer sums,
//! converted; t += bias\[c\]; then y\[c\] = t, gelu(t), y\[c\] + t, or fma(gate\[c\], t, y\[c\]).
//!
//! Rows that were [split](super::split_rows) have two sums, and `254 high[c] + low[c]`, both as
//! floats, stands for `sum[c]`.

use super::operation::operation;
use super::packed::{TILE_COLS, Tile};

mod scalar;
#[cfg(test)]
mod tests;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;

/// The sums of one row, or of the high and the low one that it was split into.
#[derive(Clone, Copy)]
pub(crate) enum RowSums<'a, T> {
    Whole(&'a [T]),
    Split([&'a [T]; 2]),
}

impl<'a, T> RowSums<'a, T> {
    /// Those of row `r` in a tile, which has two rows for each that is split.
    pub(crate) fn of(tile: &'a Tile<T>, r: usize, split: bool) -> Self {
        let row = |r: usize| -> &[T; TILE_COLS] { &tile[r] };
        if split { Self::Split([row(2 * r), row(2 * r + 1)]) } else { Self::Whole(row(r)) }
    }
}

/// One row of sums and what they are multiplied by.
#[derive(Clone, Copy)]
pub(crate) enum Sums<'a> {
    /// Float sums, and the scale of the row: 1 where activations were not quantised.
    F32(RowSums<'a, f32>, f32),
    /// Integer sums, the scale of the row, and the scale of each column.
    I32(RowSums<'a, i32>, f32, &'a [f32]),
}

impl Sums<'_> {
    /// Those of column `at` and after.
    #[allow(dead_code, reason = "some levels work on whole vectors first")]
    pub(crate) fn from(self, at: usize) -> Self {
        match self {
            Self::F32(RowSums::Whole(sums), scale) => Self::F32(RowSums::Whole(&sums[at..]), scale),
            Self::F32(RowSums::Split(sums), scale) => Self::F32(RowSums::Split(sums.map(|s| &s[at..])), scale),
            Self::I32(RowSums::Whole(sums), x, w) => Self::I32(RowSums::Whole(&sums[at..]), x, &w[at..]),
            Self::I32(RowSums::Split(sums), x, w) => Self::I32(RowSums::Split(sums.map(|s| &s[at..])), x, &w[at..]),
        }
    }
}

/// What to do with each finished value.
#[derive(Clone, Copy)]
pub(crate) enum Finish<'a> {
    Store,
    Gelu,
    Add,
    GatedAdd(&'a [f32]),
}

operation! {
    /// Finishes one row of one tile: as many columns as `y` has; all slices have at least that many
    /// values.
    FinishRow = "epilogue", (fn(sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]));
    (Scalar, Neon, Avx2, Avx512 => scalar::run)
    (Simd128, Relaxed => wasm::run, token)
}
