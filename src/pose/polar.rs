//! Nearest rotation to a 3x3 matrix.

/// Scalar arithmetic behind the signature of the kernels' `polar`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Scalar;

impl Scalar {
    /// Nearest rotation (row-major, determinant +1) to each matrix of `m`; a degenerate matrix gives some rotation.
    ///
    /// The rotation `R` that maximises `tr(R^T A)` is the quaternion of the largest eigenvalue of Horn's symmetric 4x4
    /// matrix (B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987), found by
    /// Jacobi rotations.
    pub(crate) fn polar(self, m: &[[f32; 9]], out: &mut [[f32; 9]]) {
        for (a, r) in m.iter().zip(out) {
            *r = nearest(a);
        }
    }
}

fn nearest(a: &[f32; 9]) -> [f32; 9] {
    let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = a.map(f64::from);
    let mut n = [
        [xx + yy + zz, zy - yz, xz - zx, yx - xy],
        [zy - yz, xx - yy - zz, xy + yx, zx + xz],
        [xz - zx, xy + yx, yy - xx - zz, yz + zy],
        [yx - xy, zx + xz, yz + zy, zz - xx - yy],
    ];
    let mut v = [[0.0; 4]; 4];
    for (i, row) in v.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    for _ in 0..10 {
        for p in 0..3 {
            for q in p + 1..4 {
                rotate(&mut n, &mut v, p, q);
            }
        }
    }
    let best = (1..4).fold(0, |best, i| if n[i][i] > n[best][best] { i } else { best });
    let q = [v[0][best], v[1][best], v[2][best], v[3][best]];
    let norm = q.iter().map(|e| e * e).sum::<f64>().sqrt();
    if !norm.is_finite() {
        return [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    }
    let [w, x, y, z] = q.map(|e| e / norm);
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
    .map(|e| e as f32)
}

/// One Jacobi rotation that makes `n[p][q]` zero.
fn rotate(n: &mut [[f64; 4]; 4], v: &mut [[f64; 4]; 4], p: usize, q: usize) {
    let off = n[p][q];
    if off.abs() < 1e-300 {
        return;
    }
    let theta = (n[q][q] - n[p][p]) / (2.0 * off);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for row in n.iter_mut() {
        let (a, b) = (row[p], row[q]);
        (row[p], row[q]) = (c * a - s * b, s * a + c * b);
    }
    let (a, b) = (n[p], n[q]);
    for k in 0..4 {
        n[p][k] = c * a[k] - s * b[k];
        n[q][k] = s * a[k] + c * b[k];
    }
    for row in v.iter_mut() {
        let (a, b) = (row[p], row[q]);
        (row[p], row[q]) = (c * a - s * b, s * a + c * b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Mat3, Quat, Vec3};

    fn polar(m: Mat3) -> Mat3 {
        let mut out = [[0.0; 9]];
        Scalar.polar(&[m.transpose().to_cols_array()], &mut out);
        Mat3::from_cols_array(&out[0]).transpose()
    }

    #[test]
    fn takes_the_stretch_away() {
        for i in 0..50 {
            let axis = Vec3::new((i as f32).sin(), (i as f32 * 1.7).cos(), 0.3).normalize();
            let r = Mat3::from_quat(Quat::from_axis_angle(axis, i as f32 * 0.13));
            let s = Mat3::from_cols_array(&[1.2, 0.1, 0.05, 0.1, 0.7, -0.1, 0.05, -0.1, 0.4]);
            let got = polar(r * s);
            assert!((got - r).to_cols_array().iter().all(|e| e.abs() < 1e-5), "{got} {r}");
        }
    }

    #[test]
    fn degenerate_and_mirrored_input_gives_a_rotation() {
        let zero = Mat3::ZERO;
        let line = Mat3::from_cols(Vec3::X, Vec3::X, Vec3::X);
        let mirror = Mat3::from_diagonal(Vec3::new(1.0, 1.0, -0.9));
        let nan = Mat3::from_diagonal(Vec3::new(1.0, f32::NAN, 1.0));
        for m in [zero, line, mirror, nan, Mat3::from_diagonal(Vec3::splat(-1.0))] {
            let r = polar(m);
            assert!((r.determinant() - 1.0).abs() < 1e-5, "{m}: {r}");
            assert!((r * r.transpose() - Mat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-5));
        }
    }
}
