//! Triangles of rounded cones.

use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, TAU};

/// Vertices around.
const AROUND: usize = 16;
/// Rings of a hemisphere, its pole not counted.
const RINGS: usize = 4;

/// A triangle mesh whose vertices each belong to one joint: metres, counter-clockwise outside, in
/// the rest pose.
#[derive(Debug, Default)]
pub(super) struct Solid {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) joints: Vec<u8>,
    pub(super) triangles: Vec<[u16; 3]>,
}

impl Solid {
    /// Adds two half balls, at `a` and `b` with these radii, and the cone between them, stretched
    /// by `stretch` (a factor an axis) about the line from `a` to `b`; where both are one point, it
    /// is a ball.
    pub(super) fn cone(&mut self, joint: u8, a: Vec3, b: Vec3, radii: [f32; 2], stretch: Vec3) {
        let axis = (b - a).normalize_or(Vec3::Y);
        let (side, front) = axis.any_orthonormal_pair();
        let first = self.positions.len();
        // From the ring above the pole of `a` to its equator, then from the equator of `b` to the
        // ring below its pole.
        for ring in 0..2 * RINGS {
            let (centre, radius, steps) = match ring.checked_sub(RINGS) {
                None => (a, radii[0], ring as f32 + 1.0 - RINGS as f32),
                Some(upper) => (b, radii[1], upper as f32),
            };
            let (height, width) = (FRAC_PI_2 * steps / RINGS as f32).sin_cos();
            for i in 0..AROUND {
                let (s, c) = (TAU * i as f32 / AROUND as f32).sin_cos();
                self.vertex(joint, centre, axis * height + (side * c + front * s) * width, radius, stretch);
            }
        }
        let (low, high) = (self.positions.len(), self.positions.len() + 1);
        self.vertex(joint, a, -axis, radii[0], stretch);
        self.vertex(joint, b, axis, radii[1], stretch);
        let at = |ring: usize, i: usize| (first + ring * AROUND + i % AROUND) as u16;
        let last = 2 * RINGS - 1;
        for i in 0..AROUND {
            self.triangles.push([low as u16, at(0, i + 1), at(0, i)]);
            self.triangles.push([high as u16, at(last, i), at(last, i + 1)]);
            for ring in 0..last {
                self.triangles.push([at(ring, i), at(ring, i + 1), at(ring + 1, i)]);
                self.triangles.push([at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i)]);
            }
        }
    }

    fn vertex(&mut self, joint: u8, centre: Vec3, direction: Vec3, radius: f32, stretch: Vec3) {
        self.positions.push((centre + direction * radius * stretch).to_array());
        self.normals.push((direction / stretch).normalize().to_array());
        self.joints.push(joint);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_and_outside_out() {
        for (a, b) in [(Vec3::ZERO, Vec3::X), (Vec3::Y, Vec3::new(0.3, -2.0, 0.4)), (Vec3::Z, Vec3::Z)] {
            let mut solid = Solid::default();
            solid.cone(3, a, b, [0.2, 0.3], Vec3::new(1.0, 1.0, 0.5));
            let p = |i: u16| Vec3::from(solid.positions[usize::from(i)]);
            let mut edges = std::collections::HashMap::new();
            let mut volume = 0.0;
            for &[i, j, k] in &solid.triangles {
                for (from, to) in [(i, j), (j, k), (k, i)] {
                    *edges.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
                }
                volume += p(i).dot(p(j).cross(p(k))) / 6.0;
                let face = (p(j) - p(i)).cross(p(k) - p(i));
                let normal = Vec3::from(solid.normals[usize::from(i)]);
                assert!(face.dot(normal) > -1e-6, "a face looks inwards");
            }
            assert!(edges.values().all(|&n| n == 0), "not closed");
            assert!(volume > 0.02, "{volume}");
            assert!(solid.normals.iter().all(|n| (Vec3::from(*n).length() - 1.0).abs() < 1e-5));
            assert_eq!(solid.joints.len(), solid.positions.len());
        }
    }
}
