//! Symmetric matrices in `f64`: eigenvalues by Jacobi rotations, square roots. Row-major, `n` x
//! `n`.

/// Eigenvalues and eigenvectors (columns of the second value) of the symmetric matrix `a`.
///
/// Cyclic Jacobi (Golub and Van Loan, 8.5): each rotation zeroes one off-diagonal pair; convergence
/// is quadratic, and eigenvalues are as exact as the matrix.
pub fn eigen(a: &[f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut a = a.to_vec();
    let mut v: Vec<f64> = (0..n * n).map(|i| f64::from(u8::from(i / n == i % n))).collect();
    let total: f64 = a.iter().map(|x| x * x).sum();
    for _ in 0..64 {
        let off: f64 = (0..n * n).filter(|i| i / n != i % n).map(|i| a[i] * a[i]).sum();
        if off <= 1e-28 * total {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(&mut a, &mut v, n, p, q);
            }
        }
    }
    ((0..n).map(|i| a[i * n + i]).collect(), v)
}

/// The rotation in the plane (p, q) that zeroes `a[p, q]`.
fn rotate(a: &mut [f64], v: &mut [f64], n: usize, p: usize, q: usize) {
    let apq = a[p * n + q];
    if apq == 0.0 {
        return;
    }
    let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let c = 1.0 / t.hypot(1.0);
    let s = t * c;
    for k in 0..n {
        let (x, y) = (a[k * n + p], a[k * n + q]);
        (a[k * n + p], a[k * n + q]) = (c * x - s * y, s * x + c * y);
    }
    for k in 0..n {
        let (x, y) = (a[p * n + k], a[q * n + k]);
        (a[p * n + k], a[q * n + k]) = (c * x - s * y, s * x + c * y);
    }
    for k in 0..n {
        let (x, y) = (v[k * n + p], v[k * n + q]);
        (v[k * n + p], v[k * n + q]) = (c * x - s * y, s * x + c * y);
    }
}

/// Square root of a symmetric positive semidefinite matrix; eigenvalues below zero by rounding
/// count as zero.
pub fn sqrt(a: &[f64], n: usize) -> Vec<f64> {
    let (values, vectors) = eigen(a, n);
    let mut out = vec![0.0; n * n];
    for (k, value) in values.iter().enumerate() {
        let root = value.max(0.0).sqrt();
        for i in 0..n {
            let left = root * vectors[i * n + k];
            for j in 0..n {
                out[i * n + j] += left * vectors[j * n + k];
            }
        }
    }
    out
}

/// Matrix product.
pub fn multiply(a: &[f64], b: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..n {
            let left = a[i * n + k];
            for j in 0..n {
                out[i * n + j] += left * b[k * n + j];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::testing::close;
    use super::*;

    /// A fixed symmetric positive semidefinite matrix `B B'` of rank `rank`.
    fn psd(n: usize, rank: usize) -> Vec<f64> {
        let b = |i: usize, k: usize| ((i * 7 + k * 13) as f64).sin();
        (0..n * n).map(|e| (0..rank).map(|k| b(e / n, k) * b(e % n, k)).sum()).collect()
    }

    #[test]
    fn known_eigenvalues() {
        let (mut values, _) = eigen(&[2.0, 1.0, 1.0, 2.0], 2);
        values.sort_by(f64::total_cmp);
        close(values[0], 1.0, 1e-12);
        close(values[1], 3.0, 1e-12);
    }

    #[test]
    fn vectors_rebuild_the_matrix() {
        let n = 24;
        let a = psd(n, n);
        let (values, v) = eigen(&a, n);
        for i in 0..n {
            for j in 0..n {
                let rebuilt: f64 = (0..n).map(|k| v[i * n + k] * values[k] * v[j * n + k]).sum();
                close(rebuilt, a[i * n + j], 1e-10);
                let dot: f64 = (0..n).map(|k| v[k * n + i] * v[k * n + j]).sum();
                close(dot, f64::from(u8::from(i == j)), 1e-12);
            }
        }
    }

    #[test]
    fn a_square_root_squares_back_singular_or_not() {
        for (n, rank) in [(1, 1), (9, 9), (30, 5)] {
            let a = psd(n, rank);
            let root = sqrt(&a, n);
            let square = multiply(&root, &root, n);
            a.iter().zip(&square).for_each(|(&x, &y)| close(x, y, 1e-8));
        }
    }
}
