//! A joint as the 12 vertices of an icosahedron that is placed at the joint and turned with it.

use crate::frame::{JOINT_CHANNELS, Transform};
use glam::{Mat3, Vec3};

/// Vertices of an icosahedron.
pub const VERTICES: usize = 12;

/// Vertices of the reference icosahedron: unit circumradius, centred, `sum_v v v^T = 4 I`.
///
/// Order: for each `(a, b)` of `(1, phi), (1, -phi), (-1, phi), (-1, -phi)`: `(0, a, b)`, `(a, b,
/// 0)`, `(b, 0, a)`, each over `sqrt(1 + phi^2)`.
pub const REFERENCE: [Vec3; VERTICES] = reference();

const fn reference() -> [Vec3; VERTICES] {
    /// `1 / sqrt(1 + phi^2)` and `phi / sqrt(1 + phi^2)`.
    const A: f32 = 0.525_731_1;
    const B: f32 = 0.850_650_8;
    let signs = [(A, B), (A, -B), (-A, B), (-A, -B)];
    let mut out = [Vec3::ZERO; VERTICES];
    let mut i = 0;
    while i < 4 {
        let (a, b) = signs[i];
        out[3 * i] = Vec3::new(0.0, a, b);
        out[3 * i + 1] = Vec3::new(a, b, 0.0);
        out[3 * i + 2] = Vec3::new(b, 0.0, a);
        i += 1;
    }
    out
}

/// Writes the vertices of the icosahedron of circumradius `radius` (metres) at `joint`:
/// `out[3 v + c] = (p + R (radius * REFERENCE[v]))[c]`, in the frame that `joint` is given in.
pub fn encode(joint: &Transform, radius: f32, out: &mut [f32; JOINT_CHANNELS]) {
    let turn = Mat3::from_quat(joint.rotation) * radius;
    for (v, reference) in out.chunks_exact_mut(3).zip(&REFERENCE) {
        v.copy_from_slice(&(joint.position + turn * *reference).to_array());
    }
}

/// The joint's position, metres, and the least-squares linear map `A` from the reference to
/// `vertices`, row-major.
///
/// `p` is the centroid; because the reference is isotropic, `A = 1 / (4 radius) sum_v (X_v - p)
/// REFERENCE[v]^T`. Vertices that [`encode`] wrote give the joint's rotation; others have its polar
/// factor taken.
pub fn decode(vertices: &[f32; JOINT_CHANNELS], radius: f32) -> (Vec3, [f32; 9]) {
    let vertex = |v: usize| Vec3::from_slice(&vertices[3 * v..3 * v + 3]);
    let position = (0..VERTICES).map(vertex).sum::<Vec3>() / VERTICES as f32;
    let mut a = [Vec3::ZERO; 3];
    for (v, r) in REFERENCE.iter().enumerate() {
        let d = vertex(v) - position;
        a[0] += d.x * *r;
        a[1] += d.y * *r;
        a[2] += d.z * *r;
    }
    let scale = 0.25 / radius;
    let mut map = [0.0; 9];
    for (row, v) in map.chunks_exact_mut(3).zip(a) {
        row.copy_from_slice(&(v * scale).to_array());
    }
    (position, map)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn reference_is_the_specified_isotropic_one() {
        let phi = f64::midpoint(1.0, 5f64.sqrt());
        let n = (1.0 + phi * phi).sqrt();
        let mut expected = Vec::new();
        for (a, b) in [(1.0, phi), (1.0, -phi), (-1.0, phi), (-1.0, -phi)] {
            expected.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
        }
        for (v, e) in REFERENCE.iter().zip(&expected) {
            for (x, e) in v.to_array().iter().zip(e) {
                assert!((f64::from(*x) - e / n).abs() < 5e-8);
            }
        }
        assert!(REFERENCE.iter().sum::<Vec3>().length() < 1e-6);
        for i in 0..3 {
            for k in 0..3 {
                let s: f32 = REFERENCE.iter().map(|v| v[i] * v[k]).sum();
                assert!((s - if i == k { 4.0 } else { 0.0 }).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn round_trip() {
        let joint = Transform {
            position: Vec3::new(0.3, 1.2, -0.4),
            rotation: Quat::from_euler(glam::EulerRot::YXZ, 2.0, -0.7, 0.4),
        };
        let mut x = [0.0; JOINT_CHANNELS];
        encode(&joint, 0.1, &mut x);
        assert!((Vec3::new(x[0], x[1], x[2]).distance(joint.position) - 0.1).abs() < 1e-6);
        let (p, a) = decode(&x, 0.1);
        assert!(p.distance(joint.position) < 1e-6);
        let r = Mat3::from_quat(joint.rotation);
        let a = Mat3::from_cols_array(&a).transpose();
        assert!((a - r).to_cols_array().iter().all(|e| e.abs() < 5e-6), "{a} {r}");
    }

    #[test]
    fn decode_is_the_least_squares_map() {
        let linear = Mat3::from_cols_array(&[1.1, 0.2, 0.0, -0.3, 0.7, 0.4, 0.1, 0.0, -0.9]);
        let mut x = [0.0; JOINT_CHANNELS];
        for (v, r) in x.chunks_exact_mut(3).zip(&REFERENCE) {
            v.copy_from_slice(&(Vec3::Y + linear * (*r * 0.1)).to_array());
        }
        let (p, a) = decode(&x, 0.1);
        assert!(p.distance(Vec3::Y) < 1e-6);
        assert!((Mat3::from_cols_array(&a).transpose() - linear).to_cols_array().iter().all(|e| e.abs() < 5e-6));
    }
}
