//! The reference: one row of one tile.

use super::{Finish, RowSums, Sums};
use crate::kernels::math::gelu;
use crate::kernels::packed::TILE_COLS;
use crate::kernels::split_rows::BASE;

#[inline(always)]
pub(super) fn run(sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    let n = y.len();
    assert!(n <= TILE_COLS, "one tile");
    let mut t = [0.0f32; TILE_COLS];
    let t = &mut t[..n];
    match sums {
        Sums::F32(sums, x_scale) => scale(sums, t, |sum| sum, std::iter::repeat(x_scale)),
        Sums::I32(sums, x_scale, w_scale) => {
            scale(sums, t, |sum| sum as f32, w_scale[..n].iter().map(|w| x_scale * w));
        }
    }
    for (t, b) in t.iter_mut().zip(&bias[..n]) {
        *t += b;
    }
    match finish {
        Finish::Store => y.copy_from_slice(t),
        Finish::Gelu => {
            for (y, t) in y.iter_mut().zip(&*t) {
                *y = gelu(*t);
            }
        }
        Finish::Add => {
            for (y, t) in y.iter_mut().zip(&*t) {
                *y += t;
            }
        }
        Finish::GatedAdd(gate) => {
            for ((y, t), g) in y.iter_mut().zip(&*t).zip(&gate[..n]) {
                *y = g.mul_add(*t, *y);
            }
        }
    }
}

/// Sums as floats times the scale of their column.
#[inline(always)]
fn scale<T: Copy>(sums: RowSums<'_, T>, t: &mut [f32], to_f32: impl Fn(T) -> f32, scales: impl Iterator<Item = f32>) {
    let n = t.len();
    match sums {
        RowSums::Whole(sums) => {
            for ((t, sum), scale) in t.iter_mut().zip(&sums[..n]).zip(scales) {
                *t = to_f32(*sum) * scale;
            }
        }
        RowSums::Split([high, low]) => {
            for (((t, high), low), scale) in t.iter_mut().zip(&high[..n]).zip(&low[..n]).zip(scales) {
                *t = (BASE * to_f32(*high) + to_f32(*low)) * scale;
            }
        }
    }
}
