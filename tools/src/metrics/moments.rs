//! Mean and covariance of pose features, gathered over any number of recordings.

use super::RATE;
use glam::Vec3;
use visavis::Frame;

/// Running mean and covariance of vectors (Welford's update), in `f64`.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    count: usize,
    mean: Vec<f64>,
    /// Sum of outer products of deviations from the mean, row-major.
    scatter: Vec<f64>,
}

impl Moments {
    /// No samples yet of vectors of `dim` values.
    pub fn new(dim: usize) -> Self {
        Self { count: 0, mean: vec![0.0; dim], scatter: vec![0.0; dim * dim] }
    }

    /// Length of the vectors.
    pub fn dim(&self) -> usize {
        self.mean.len()
    }

    /// Samples so far.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Mean of the samples.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Takes a sample in. A sample with another number of values, or with one that is not finite,
    /// is left out.
    pub fn push(&mut self, sample: &[f64]) {
        if sample.len() != self.dim() || !sample.iter().all(|x| x.is_finite()) {
            return;
        }
        self.count += 1;
        let n = self.count as f64;
        let before: Vec<f64> = sample.iter().zip(&self.mean).map(|(x, m)| x - m).collect();
        self.mean.iter_mut().zip(&before).for_each(|(m, d)| *m += d / n);
        // (x - old mean)(x - new mean)' = (n - 1) / n (x - old mean)(x - old mean)'
        self.add_outer(&before, (n - 1.0) / n);
    }

    /// Pools with the samples of `other`, as if all had been pushed here. Other dimensions are left
    /// out.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 || other.dim() != self.dim() {
            return;
        }
        let (a, b) = (self.count as f64, other.count as f64);
        let apart: Vec<f64> = other.mean.iter().zip(&self.mean).map(|(y, x)| y - x).collect();
        self.scatter.iter_mut().zip(&other.scatter).for_each(|(s, o)| *s += o);
        self.add_outer(&apart, a * b / (a + b));
        self.mean.iter_mut().zip(&apart).for_each(|(m, d)| *m += d * b / (a + b));
        self.count += other.count;
    }

    fn add_outer(&mut self, d: &[f64], weight: f64) {
        for (row, &x) in self.scatter.chunks_exact_mut(d.len()).zip(d) {
            row.iter_mut().zip(d).for_each(|(s, &y)| *s += weight * x * y);
        }
    }

    /// Unbiased covariance, row-major; shrunk towards its diagonal when samples are few. `None`
    /// below two samples.
    ///
    /// With `n` samples of `d` values the off-diagonal is multiplied by `min(1, n / (d + 1))`:
    /// below `d + 1` samples the covariance has no full rank, and what it says about directions it
    /// never saw would pass for knowledge.
    pub fn covariance(&self) -> Option<Vec<f64>> {
        if self.count < 2 {
            return None;
        }
        let d = self.dim();
        let keep = (self.count as f64 / (d + 1) as f64).min(1.0);
        let scale = 1.0 / (self.count - 1) as f64;
        let entry = |(i, s): (usize, &f64)| s * scale * if i / d == i % d { 1.0 } else { keep };
        Some(self.scatter.iter().enumerate().map(entry).collect())
    }
}

/// Joint positions in the agent's root (heading) frame, metres.
fn pose(frame: &Frame) -> impl Iterator<Item = Vec3> {
    frame.global.iter().map(|t| frame.root.to_local(t.position))
}

/// Distribution of poses for FGD (SARAH 4): joint positions in the agent's root frame, metres, one
/// sample a frame.
pub fn pose_moments(frames: &[Frame]) -> Moments {
    let mut moments = Moments::new(frames.first().map_or(0, |f| 3 * f.global.len()));
    for frame in frames {
        let sample: Vec<f64> = pose(frame).flat_map(|p| p.to_array().map(f64::from)).collect();
        moments.push(&sample);
    }
    moments
}

/// Distribution of accelerations for FGD_acc (SARAH 4): second differences of joint positions in
/// the agent's root frame, m/s², one sample a frame but the first and the last.
pub fn acceleration_moments(frames: &[Frame]) -> Moments {
    let poses: Vec<Vec<Vec3>> = frames.iter().map(|frame| pose(frame).collect()).collect();
    let mut moments = Moments::new(poses.first().map_or(0, |p| 3 * p.len()));
    for w in poses.windows(3) {
        let joints = w[0].iter().zip(&w[1]).zip(&w[2]);
        let accelerations = joints.map(|((a, b), c)| a.as_dvec3() - 2.0 * b.as_dvec3() + c.as_dvec3());
        let sample: Vec<f64> = accelerations.flat_map(|a| (a * RATE * RATE).to_array()).collect();
        moments.push(&sample);
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    fn of(samples: &[[f64; 2]]) -> Moments {
        let mut moments = Moments::new(2);
        samples.iter().for_each(|s| moments.push(s));
        moments
    }

    #[test]
    fn mean_and_covariance_of_four_points() {
        let m = of(&[[0.0, 0.0], [2.0, 0.0], [0.0, 4.0], [2.0, 4.0]]);
        assert_eq!(m.mean(), [1.0, 2.0]);
        let c = m.covariance().unwrap();
        let want = [4.0 / 3.0, 0.0, 0.0, 16.0 / 3.0];
        c.iter().zip(want).for_each(|(&x, y)| close(x, y, 1e-12));
    }

    #[test]
    fn merging_equals_pushing() {
        let samples: Vec<[f64; 2]> = (0..20).map(|i| [(i as f64).sin(), (i as f64 * 1.7).cos() + 5.0]).collect();
        let mut merged = of(&samples[..7]);
        merged.merge(&of(&samples[7..]));
        merged.merge(&Moments::new(2));
        let whole = of(&samples);
        assert_eq!(merged.count(), 20);
        whole.mean.iter().zip(&merged.mean).for_each(|(&x, &y)| close(x, y, 1e-12));
        whole.scatter.iter().zip(&merged.scatter).for_each(|(&x, &y)| close(x, y, 1e-12));
    }

    #[test]
    fn few_samples_are_shrunk_to_the_diagonal() {
        // Two samples of two values: kept with 2/3.
        let c = of(&[[0.0, 0.0], [2.0, 2.0]]).covariance().unwrap();
        close(c[0], 2.0, 1e-12);
        close(c[1], 2.0 * 2.0 / 3.0, 1e-12);
        assert_eq!(of(&[[1.0, 1.0]]).covariance(), None);
    }

    #[test]
    fn unusable_samples_are_left_out() {
        let mut m = of(&[[1.0, 2.0]]);
        m.push(&[f64::NAN, 0.0]);
        m.push(&[1.0]);
        assert_eq!(m.count(), 1);
    }

    #[test]
    fn poses_are_seen_from_the_root() {
        let r = recording(10, |_, t, p| p.iter_mut().for_each(|p| p.z += 2.0 * t));
        let moments = pose_moments(&r.frames);
        assert_eq!((moments.dim(), moments.count()), (21, 10));
        // The walk is gone, the left hand stays 0.7 m to the left.
        close(moments.mean()[6], 0.7, 1e-6);
        close(moments.mean()[2], 0.0, 1e-6);
        assert!(moments.covariance().unwrap().iter().all(|c| c.abs() < 1e-9));
    }

    #[test]
    fn accelerations_are_per_second_squared() {
        let r = recording(12, |_, t, p| p[2].y += 2.0 * t * t);
        let moments = acceleration_moments(&r.frames);
        assert_eq!(moments.count(), 10);
        close(moments.mean()[7], 4.0, 1e-2);
        close(moments.mean()[4], 0.0, 1e-6);
    }
}
