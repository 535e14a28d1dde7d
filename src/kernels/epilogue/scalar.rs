//! The reference: one row of one tile; variants are the same body, compiled for their level.

use super::{Finish, Sums};
use crate::kernels::math::gelu;
use crate::kernels::packed::TILE_COLS;
use crate::kernels::split_rows::BASE;

pub(super) fn run(sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    body(sums, bias, finish, y);
}

#[inline(always)]
pub(super) fn body(sums: Sums<'_>, bias: &[f32], finish: Finish<'_>, y: &mut [f32]) {
    let n = y.len();
    assert!(n <= TILE_COLS, "one tile");
    let mut t = [0.0f32; TILE_COLS];
    let t = &mut t[..n];
    match sums {
        Sums::F32(sums) => t.copy_from_slice(&sums[..n]),
        Sums::Scaled(sums, x_scale) => {
            for (t, sum) in t.iter_mut().zip(&sums[..n]) {
                *t = sum * x_scale;
            }
        }
        Sums::I32(sums, x_scale, w_scale) => {
            for ((t, sum), w) in t.iter_mut().zip(&sums[..n]).zip(&w_scale[..n]) {
                *t = *sum as f32 * (x_scale * w);
            }
        }
        Sums::ScaledPair([high, low], x_scale) => {
            for ((t, high), low) in t.iter_mut().zip(&high[..n]).zip(&low[..n]) {
                *t = (BASE * high + low) * x_scale;
            }
        }
        Sums::I32Pair([high, low], x_scale, w_scale) => {
            for (((t, high), low), w) in t.iter_mut().zip(&high[..n]).zip(&low[..n]).zip(&w_scale[..n]) {
                *t = (BASE * *high as f32 + *low as f32) * (x_scale * w);
            }
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
