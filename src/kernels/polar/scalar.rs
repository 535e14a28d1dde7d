//! The reference: 16 matrices side by side in plain arrays.

use crate::kernels::math::LANES;

type V = [f32; LANES];

/// Jacobi converges quadratically: off-diagonal entries reach rounding after four sweeps, even from
/// repeated eigenvalues.
pub(super) const SWEEPS: usize = 5;
/// Entries that a sweep clears, in this order.
pub(super) const PAIRS: [(usize, usize); 6] = [(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)];

#[inline(always)]
pub(super) fn run(m: &[[f32; 9]], out: &mut [[f32; 9]]) {
    for (m, out) in m.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let mut a = [[0.0f32; LANES]; 9];
        for (lane, m) in m.iter().enumerate() {
            for (a, v) in a.iter_mut().zip(scaled(m)) {
                a[lane] = v;
            }
        }
        let r = block(&a);
        for (lane, out) in out.iter_mut().enumerate() {
            for (i, v) in out.iter_mut().enumerate() {
                *v = r[i][lane];
            }
        }
    }
}

/// Scaled to a largest entry of 1, so that products neither overflow nor vanish; the identity where
/// that cannot be.
#[inline(always)]
pub(super) fn scaled(m: &[f32; 9]) -> [f32; 9] {
    let top = m.iter().fold(0.0f32, |t, v| t.max(v.abs()));
    let finite = m.iter().all(|v| v.is_finite()) && top > 0.0;
    let mut out = [0.0; 9];
    for (i, (out, v)) in out.iter_mut().zip(m).enumerate() {
        *out = if finite { v / top } else { f32::from(i % 4 == 0) };
    }
    out
}

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> V {
    let mut v = [0.0; LANES];
    for (i, v) in v.iter_mut().enumerate() {
        *v = f(i);
    }
    v
}

/// Rotations of 16 matrices, entry-major.
#[inline(always)]
fn block(a: &[V; 9]) -> [V; 9] {
    let at = |r: usize, c: usize| &a[3 * r + c];
    // K for R that maps the columns' side to the rows' side: tr(R^T A) = q^T K q with q = (w, x, y,
    // z).
    let mut k = [[[0.0f32; LANES]; 4]; 4];
    let (xx, yy, zz) = (at(0, 0), at(1, 1), at(2, 2));
    k[0][0] = each(|i| xx[i] + yy[i] + zz[i]);
    k[1][1] = each(|i| xx[i] - yy[i] - zz[i]);
    k[2][2] = each(|i| yy[i] - xx[i] - zz[i]);
    k[3][3] = each(|i| zz[i] - xx[i] - yy[i]);
    k[0][1] = each(|i| at(2, 1)[i] - at(1, 2)[i]);
    k[0][2] = each(|i| at(0, 2)[i] - at(2, 0)[i]);
    k[0][3] = each(|i| at(1, 0)[i] - at(0, 1)[i]);
    k[1][2] = each(|i| at(1, 0)[i] + at(0, 1)[i]);
    k[1][3] = each(|i| at(0, 2)[i] + at(2, 0)[i]);
    k[2][3] = each(|i| at(2, 1)[i] + at(1, 2)[i]);
    let mut v = [[[0.0f32; LANES]; 4]; 4];
    for (i, row) in v.iter_mut().enumerate() {
        row[i] = [1.0; LANES];
    }
    for _ in 0..SWEEPS {
        for (p, q) in PAIRS {
            rotate(&mut k, &mut v, p, q);
        }
    }
    // The eigenvector (a column of v) of the largest diagonal entry.
    let mut best = k[0][0];
    let mut quat: [V; 4] = [v[0][0], v[1][0], v[2][0], v[3][0]];
    for c in 1..4 {
        for i in 0..LANES {
            let better = k[c][c][i] > best[i];
            best[i] = if better { k[c][c][i] } else { best[i] };
            for (q, v) in quat.iter_mut().zip(&v) {
                q[i] = if better { v[c][i] } else { q[i] };
            }
        }
    }
    let norm = each(|i| {
        let [w, x, y, z] = [quat[0][i], quat[1][i], quat[2][i], quat[3][i]];
        1.0 / w.mul_add(w, x.mul_add(x, y.mul_add(y, z * z))).sqrt()
    });
    let [w, x, y, z] = [0, 1, 2, 3].map(|c: usize| each(|i| quat[c][i] * norm[i]));
    let diag = |a: &V, b: &V| each(|i| (-2.0f32).mul_add(a[i].mul_add(a[i], b[i] * b[i]), 1.0));
    let plus = |a: &V, b: &V, c: &V, d: &V| each(|i| 2.0 * a[i].mul_add(b[i], c[i] * d[i]));
    let minus = |a: &V, b: &V, c: &V, d: &V| each(|i| 2.0 * a[i].mul_add(b[i], -(c[i] * d[i])));
    [
        diag(&y, &z),
        minus(&x, &y, &w, &z),
        plus(&x, &z, &w, &y),
        plus(&x, &y, &w, &z),
        diag(&x, &z),
        minus(&y, &z, &w, &x),
        minus(&x, &z, &w, &y),
        plus(&y, &z, &w, &x),
        diag(&x, &y),
    ]
}

/// One Jacobi rotation that clears k\[p\]\[q\] (upper triangle kept), accumulated into v.
///
/// t = sign(theta) / (|theta| + sqrt(theta^2 + 1)) with theta = (k_qq - k_pp) / (2 k_pq), written
/// as 2 k_pq sign(d) / (|d| + sqrt(d^2 + 4 k_pq^2)), d = k_qq - k_pp, which needs no test for k_pq
/// = 0.
#[inline(always)]
fn rotate(k: &mut [[V; 4]; 4], v: &mut [[V; 4]; 4], p: usize, q: usize) {
    let apq = k[p][q];
    let d = each(|i| k[q][q][i] - k[p][p][i]);
    let t = each(|i| {
        let twice = 2.0 * apq[i];
        let root = d[i].mul_add(d[i], twice * twice).sqrt();
        let sign = if d[i] < 0.0 { -1.0 } else { 1.0 };
        twice * sign / (d[i].abs() + root).max(1e-30)
    });
    let c = each(|i| 1.0 / t[i].mul_add(t[i], 1.0).sqrt());
    let s = each(|i| t[i] * c[i]);
    for i in 0..LANES {
        k[p][p][i] = (-t[i]).mul_add(apq[i], k[p][p][i]);
        k[q][q][i] = t[i].mul_add(apq[i], k[q][q][i]);
        k[p][q][i] = 0.0;
    }
    for r in (0..4).filter(|&r| r != p && r != q) {
        let (rp, rq) = ((r.min(p), r.max(p)), (r.min(q), r.max(q)));
        let (a, b) = (k[rp.0][rp.1], k[rq.0][rq.1]);
        k[rp.0][rp.1] = each(|i| c[i].mul_add(a[i], -(s[i] * b[i])));
        k[rq.0][rq.1] = each(|i| s[i].mul_add(a[i], c[i] * b[i]));
    }
    for row in v {
        let (a, b) = (row[p], row[q]);
        row[p] = each(|i| c[i].mul_add(a[i], -(s[i] * b[i])));
        row[q] = each(|i| s[i].mul_add(a[i], c[i] * b[i]));
    }
}
