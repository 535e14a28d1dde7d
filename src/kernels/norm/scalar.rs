//! The reference: mean, then squared deviations, then the row.

use super::EPSILON;
use crate::kernels::math::{LANES, fold};

#[inline(always)]
pub(super) fn run(x: &[f32], shift: &[f32], scale: &[f32], y: &mut [f32]) {
    let n = x.len();
    assert!(n > 0 && shift.len() == n && scale.len() == n && y.len() == n, "norm: equal lengths");
    let (head, tail) = x.as_chunks::<LANES>();
    let mut sum = [0.0f32; LANES];
    for chunk in head {
        for (s, v) in sum.iter_mut().zip(chunk) {
            *s += v;
        }
    }
    for (s, v) in sum.iter_mut().zip(tail) {
        *s += v;
    }
    let mean = fold(sum) / n as f32;
    let mut square = [0.0f32; LANES];
    for chunk in head {
        for (s, v) in square.iter_mut().zip(chunk) {
            *s = (v - mean).mul_add(v - mean, *s);
        }
    }
    for (s, v) in square.iter_mut().zip(tail) {
        *s = (v - mean).mul_add(v - mean, *s);
    }
    let rstd = 1.0 / (fold(square) / n as f32 + EPSILON).sqrt();
    for (((y, x), shift), scale) in y.iter_mut().zip(x).zip(shift).zip(scale) {
        *y = ((x - mean) * rstd).mul_add(*scale, *shift);
    }
}
