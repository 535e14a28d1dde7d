//! Rotations as continuous Euler angles.

use glam::{DMat3, Quat};
use std::f64::consts::{PI, TAU};

/// Angles `z, x, y` of `R = Rz(z) Rx(x) Ry(y)`, radians, that follow a rotation over time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Angles([f64; 3]);

impl Angles {
    /// The angles of `q` nearest to those before.
    ///
    /// A rotation has two triples up to full turns, `(z, x, y)` and `(z + pi, pi - x, y + pi)`; the
    /// nearer one is taken, so that `x` may pass a quarter turn. There (`cos x = 0`) only `z + y`
    /// or `z - y` is determined: `z` stays as it was. In every case `x` and `y` are read from
    /// `Rz(z)^T R`, so the triple gives `R` back, however close to that point.
    pub(super) fn follow(&mut self, q: Quat) -> [f64; 3] {
        let r = DMat3::from_quat(q.as_dquat().normalize());
        let (r01, r11) = (r.y_axis.x, r.y_axis.y);
        let z = if r01.hypot(r11) < 1e-6 { self.0[0] } else { (-r01).atan2(r11) };
        let first = solve(&r, z);
        let second = solve(&r, z + PI);
        let [first, second] = [first, second].map(|a| nearest_turns(a, self.0));
        let distance = |a: [f64; 3]| a.iter().zip(self.0).map(|(a, b)| (a - b).abs()).sum::<f64>();
        self.0 = if distance(second) < distance(first) { second } else { first };
        self.0
    }
}

/// The triple with this `z`, where `R = Rz(z) Rx Ry`.
fn solve(r: &DMat3, z: f64) -> [f64; 3] {
    let m = DMat3::from_rotation_z(-z) * *r;
    // Rx Ry = [[cy, 0, sy], [sx sy, cx, -sx cy], [-cx sy, sx, cx cy]]; columns are x_axis, y_axis,
    // z_axis.
    [z, m.y_axis.z.atan2(m.y_axis.y), m.z_axis.x.atan2(m.x_axis.x)]
}

fn nearest_turns(mut angles: [f64; 3], before: [f64; 3]) -> [f64; 3] {
    for (a, b) in angles.iter_mut().zip(before) {
        *a += TAU * ((b - *a) / TAU).round();
    }
    angles
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, EulerRot};

    fn back([z, x, y]: [f64; 3]) -> DQuat {
        DQuat::from_rotation_z(z) * DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y)
    }

    fn check(angles: &mut Angles, q: Quat) -> f64 {
        let before = angles.0;
        let now = angles.follow(q);
        let error = back(now).angle_between(q.as_dquat().normalize());
        let error = error.min(TAU - error);
        assert!(error < 1e-6, "{q} gives {now:?}: off by {error}");
        now.iter().zip(before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn gives_the_rotation_back_everywhere() {
        let mut angles = Angles::default();
        for i in 0..=24 {
            for k in 0..=24 {
                for l in 0..=24 {
                    let [a, b, c] = [i, k, l].map(|v| (v as f32 - 12.0) * std::f32::consts::PI / 12.0);
                    check(&mut angles, Quat::from_euler(EulerRot::ZXY, a, b, c));
                }
            }
        }
    }

    #[test]
    fn goes_through_a_quarter_turn_without_a_jump() {
        // A knee bends to 137 degrees and back; a slight twist makes `z` swing near 90 degrees, but
        // not over and not for good.
        for (twist, most) in [(0.0, 0.1), (0.001, 1.6)] {
            let mut angles = Angles::default();
            for i in 0..200 {
                let bend = 2.4 * (1.0 - (i as f32 * 0.0314).cos()) / 2.0;
                let step = check(&mut angles, Quat::from_rotation_x(bend) * Quat::from_rotation_z(twist));
                assert!(i == 0 || step < most, "twist {twist}, frame {i}: {step}");
            }
            assert!(angles.0.iter().all(|a| a.abs() < 0.01), "{:?}", angles.0);
        }
    }

    #[test]
    fn turning_on_the_spot_goes_on_beyond_half_a_turn() {
        let mut angles = Angles::default();
        for i in 0..=300 {
            let step = check(&mut angles, Quat::from_rotation_y(i as f32 * 0.1) * Quat::from_rotation_x(0.2));
            assert!(i == 0 || step < 0.11, "frame {i}: {step}");
        }
        assert!(angles.0[2] > 29.0, "{:?}", angles.0);
    }
}
