//! Frechet distance between two Gaussians fitted to pose distributions (FGD, FGD_acc).

use super::Moments;
use super::linalg::{eigen, multiply, sqrt};

/// Frechet distance (squared 2-Wasserstein distance of the fitted Gaussians; Dowson and Landau
/// 1982, as used by FGD): `|m1 - m2|² + tr(S1 + S2 - 2 (S1^½ S2 S1^½)^½)`.
///
/// In the square of the samples' unit: m² for [`pose_moments`](super::pose_moments), (m/s²)² for
/// [`acceleration_moments`](super::acceleration_moments). For speaking and non-speaking clips,
/// merge the moments of all clips of a class on each side first (pooled, as SARAH 4). `None` when
/// dimensions differ or a side has less than two samples.
pub fn frechet(a: &Moments, b: &Moments) -> Option<f64> {
    let n = a.dim();
    if n == 0 || n != b.dim() {
        return None;
    }
    let (cov_a, cov_b) = (a.covariance()?, b.covariance()?);
    let means: f64 = a.mean().iter().zip(b.mean()).map(|(x, y)| (x - y) * (x - y)).sum();
    let trace = |m: &[f64]| (0..n).map(|i| m[i * n + i]).sum::<f64>();
    let root = sqrt(&cov_a, n);
    let mut inner = multiply(&multiply(&root, &cov_b, n), &root, n);
    symmetrise(&mut inner, n);
    let cross: f64 = eigen(&inner, n).0.iter().map(|v| v.max(0.0).sqrt()).sum();
    Some((means + trace(&cov_a) + trace(&cov_b) - 2.0 * cross).max(0.0))
}

fn symmetrise(m: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..i {
            let x = 0.5 * (m[i * n + j] + m[j * n + i]);
            (m[i * n + j], m[j * n + i]) = (x, x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pose_moments;
    use super::super::testing::{close, recording};
    use super::*;

    /// Samples with exactly this mean and covariance `diag(variance)`, turned by `angle` about the
    /// mean.
    fn gaussian(mean: [f64; 2], variance: [f64; 2], angle: f64) -> Moments {
        let mut moments = Moments::new(2);
        let (s, c) = angle.sin_cos();
        // Unbiased variance of the four corners (±x, ±y) is 4/3 x², 4/3 y².
        let [x, y] = variance.map(|v| (v * 0.75).sqrt());
        for (x, y) in [(x, y), (-x, y), (x, -y), (-x, -y)] {
            moments.push(&[mean[0] + c * x - s * y, mean[1] + s * x + c * y]);
        }
        moments
    }

    #[test]
    fn of_itself_is_zero() {
        let a = gaussian([1.0, 2.0], [3.0, 0.5], 0.7);
        close(frechet(&a, &a).unwrap(), 0.0, 1e-12);
    }

    #[test]
    fn apart_by_their_means() {
        let (a, b) = (gaussian([0.0, 0.0], [1.0, 2.0], 0.3), gaussian([3.0, 4.0], [1.0, 2.0], 0.3));
        close(frechet(&a, &b).unwrap(), 25.0, 1e-10);
    }

    #[test]
    fn commuting_covariances() {
        // tr = sum of (sqrt(v1) - sqrt(v2))²: (2 - 3)² + (1 - 5)².
        let (a, b) = (gaussian([0.0, 0.0], [4.0, 1.0], 0.0), gaussian([0.0, 0.0], [9.0, 25.0], 0.0));
        close(frechet(&a, &b).unwrap(), 17.0, 1e-10);
    }

    #[test]
    fn covariances_that_do_not_commute() {
        // S1 = diag(4, 1), S2 = 0.5 [[5, 3], [3, 5]] (variances 4 and 1 turned by 45 degrees).
        // For 2x2, tr sqrt(M) = sqrt(tr M + 2 sqrt(det M)); tr(S1 S2) = 12.5, det = 16.
        let (a, b) =
            (gaussian([0.0, 0.0], [4.0, 1.0], 0.0), gaussian([0.0, 0.0], [4.0, 1.0], std::f64::consts::FRAC_PI_4));
        let want = 5.0 + 5.0 - 2.0 * (12.5_f64 + 8.0).sqrt();
        close(frechet(&a, &b).unwrap(), want, 1e-10);
        close(frechet(&b, &a).unwrap(), want, 1e-10);
    }

    #[test]
    fn poses_that_differ_by_a_raised_hand() {
        let low = recording(200, |i, _, p| p[2].y += 0.01 * (i as f32).sin());
        let high = recording(200, |i, _, p| p[2].y += 0.3 + 0.01 * (i as f32).sin());
        let d = frechet(&pose_moments(&low.frames), &pose_moments(&high.frames)).unwrap();
        close(d, 0.09, 1e-5);
    }

    #[test]
    fn unlike_or_empty_sides_are_none() {
        let a = gaussian([0.0, 0.0], [1.0, 1.0], 0.0);
        assert_eq!(frechet(&a, &Moments::new(3)), None);
        assert_eq!(frechet(&a, &Moments::new(2)), None);
        assert_eq!(frechet(&Moments::new(0), &Moments::new(0)), None);
    }
}
