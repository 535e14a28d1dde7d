//! The reference: [`math`]'s functions, cell by cell.

use crate::kernels::math::{sigmoid, tanh};

#[inline(always)]
pub(super) fn run(gates: &[f32], c: &mut [f32], h: &mut [f32]) {
    let n = c.len();
    let ([i, f], [g, o]) = ([&gates[..n], &gates[n..2 * n]], [&gates[2 * n..3 * n], &gates[3 * n..4 * n]]);
    let h = &mut h[..n];
    for k in 0..n {
        c[k] = sigmoid(f[k]).mul_add(c[k], sigmoid(i[k]) * tanh(g[k]));
        h[k] = sigmoid(o[k]) * tanh(c[k]);
    }
}
