//! Four matrices side by side in vectors; the reference's operations in its order.

use std::arch::wasm32::*;

use super::scalar::{PAIRS, SWEEPS};
use crate::kernels::wasm::Madd;

/// Matrices side by side.
const SIDE: usize = 4;

#[inline(always)]
pub(super) fn run<L: Madd>(level: L, m: &[[f32; 9]], out: &mut [[f32; 9]]) {
    for (m, out) in m.chunks(SIDE).zip(out.chunks_mut(SIDE)) {
        let mut a = [[0.0f32; SIDE]; 9];
        for (lane, m) in m.iter().enumerate() {
            for (a, v) in a.iter_mut().zip(super::scalar::scaled(m)) {
                a[lane] = v;
            }
        }
        let mut k = [f32x4_splat(0.0); 9];
        for (k, a) in k.iter_mut().zip(&a) {
            *k = f32x4(a[0], a[1], a[2], a[3]);
        }
        let r = block(level, &k);
        for i in 0..9 {
            let mut lanes = [0.0f32; SIDE];
            crate::kernels::wasm::store4(&mut lanes, 0, r[i]);
            out.iter_mut().zip(lanes).for_each(|(out, v)| out[i] = v);
        }
    }
}

/// Rotations of four matrices, entry-major.
#[inline(always)]
fn block<L: Madd>(level: L, a: &[v128; 9]) -> [v128; 9] {
    let (zero, one) = (f32x4_splat(0.0), f32x4_splat(1.0));
    let at = |r: usize, c: usize| a[3 * r + c];
    let sub2 = |a, b, c| f32x4_sub(f32x4_sub(a, b), c);
    let (xx, yy, zz) = (at(0, 0), at(1, 1), at(2, 2));
    let mut k = [[zero; 4]; 4];
    k[0][0] = f32x4_add(f32x4_add(xx, yy), zz);
    k[1][1] = sub2(xx, yy, zz);
    k[2][2] = sub2(yy, xx, zz);
    k[3][3] = sub2(zz, xx, yy);
    k[0][1] = f32x4_sub(at(2, 1), at(1, 2));
    k[0][2] = f32x4_sub(at(0, 2), at(2, 0));
    k[0][3] = f32x4_sub(at(1, 0), at(0, 1));
    k[1][2] = f32x4_add(at(1, 0), at(0, 1));
    k[1][3] = f32x4_add(at(0, 2), at(2, 0));
    k[2][3] = f32x4_add(at(2, 1), at(1, 2));
    let mut v = [[zero; 4]; 4];
    for i in 0..4 {
        v[i][i] = one;
    }
    for _ in 0..SWEEPS {
        for (p, q) in PAIRS {
            rotate(level, &mut k, &mut v, p, q);
        }
    }
    // The eigenvector (a column of v) of the largest diagonal entry.
    let mut best = k[0][0];
    let mut quat = [v[0][0], v[1][0], v[2][0], v[3][0]];
    for c in 1..4 {
        let better = f32x4_gt(k[c][c], best);
        best = v128_bitselect(k[c][c], best, better);
        for i in 0..4 {
            quat[i] = v128_bitselect(v[i][c], quat[i], better);
        }
    }
    let fma = |a, b, c| level.fma(a, b, c);
    let [w, x, y, z] = quat;
    let square = fma(w, w, fma(x, x, fma(y, y, f32x4_mul(z, z))));
    let norm = f32x4_div(one, f32x4_sqrt(square));
    let (w, x, y, z) = (f32x4_mul(w, norm), f32x4_mul(x, norm), f32x4_mul(y, norm), f32x4_mul(z, norm));
    let two = f32x4_splat(2.0);
    let diag = |a, b| fma(f32x4_splat(-2.0), fma(a, a, f32x4_mul(b, b)), one);
    let plus = |a, b, c, d| f32x4_mul(two, fma(a, b, f32x4_mul(c, d)));
    let minus = |a, b, c, d| f32x4_mul(two, fma(a, b, f32x4_neg(f32x4_mul(c, d))));
    [
        diag(y, z),
        minus(x, y, w, z),
        plus(x, z, w, y),
        plus(x, y, w, z),
        diag(x, z),
        minus(y, z, w, x),
        minus(x, z, w, y),
        plus(y, z, w, x),
        diag(x, y),
    ]
}

/// One Jacobi rotation, as the reference's.
#[inline(always)]
fn rotate<L: Madd>(level: L, k: &mut [[v128; 4]; 4], v: &mut [[v128; 4]; 4], p: usize, q: usize) {
    let (zero, one) = (f32x4_splat(0.0), f32x4_splat(1.0));
    let fma = |a, b, c| level.fma(a, b, c);
    let apq = k[p][q];
    let d = f32x4_sub(k[q][q], k[p][p]);
    let twice = f32x4_mul(f32x4_splat(2.0), apq);
    let root = f32x4_sqrt(fma(d, d, f32x4_mul(twice, twice)));
    let sign = v128_bitselect(f32x4_splat(-1.0), one, f32x4_lt(d, zero));
    // The larger, as a comparison: a number, whatever it is compared with.
    let below = f32x4_pmax(f32x4_splat(1e-30), f32x4_add(f32x4_abs(d), root));
    let t = f32x4_div(f32x4_mul(twice, sign), below);
    let c = f32x4_div(one, f32x4_sqrt(fma(t, t, one)));
    let s = f32x4_mul(t, c);
    k[p][p] = fma(f32x4_neg(t), apq, k[p][p]);
    k[q][q] = fma(t, apq, k[q][q]);
    k[p][q] = zero;
    let turned = |a, b| (fma(c, a, f32x4_neg(f32x4_mul(s, b))), fma(s, a, f32x4_mul(c, b)));
    for r in (0..4).filter(|&r| r != p && r != q) {
        let (rp, rq) = ((r.min(p), r.max(p)), (r.min(q), r.max(q)));
        (k[rp.0][rp.1], k[rq.0][rq.1]) = turned(k[rp.0][rp.1], k[rq.0][rq.1]);
    }
    for row in v {
        (row[p], row[q]) = turned(row[p], row[q]);
    }
}
