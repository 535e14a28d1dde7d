//! Motion vectors x `[12 J]` to frames.
//!
//! Hips in the world, the other joints' positions relative to them (`3 J`); first and second
//! column of each joint's local rotation (`6 J`), the hips' in the world; velocities of the joints'
//! world positions, metres a frame (`3 J`). Frames take the rotations and the height of the hips;
//! the hips' way over the floor is the sum of their velocities, as positions jitter by centimetres.
//! The rest helps the network alone.

use crate::error::{Error, ErrorKind, Result};
use crate::frame::{FPS, Frame, Root};
use crate::rig::Rig;
use glam::{Mat3, Quat, Vec3};

/// Length of the motion vector of `joints` joints.
pub const fn motion_size(joints: usize) -> usize {
    12 * joints
}

/// Frame `index` of vector `x` on `rig`; `way`, the hips' place on the floor (x, z) in the frame
/// before, goes on by their velocity.
///
/// # Errors
/// [`ErrorKind::State`] where the numbers are none.
///
/// # Panics
/// When `x` is not that of the rig.
pub(super) fn frame(rig: &Rig, index: usize, x: &[f32], way: &mut [f64; 2]) -> Result<Frame> {
    let n = rig.len();
    assert_eq!(x.len(), motion_size(n), "a motion vector of this rig");
    if !x.iter().all(|v| v.is_finite()) {
        let message = format!("frame {index} holds no numbers: the bundle's weights are unusable; export it again");
        return Err(Error::new(ErrorKind::State, message));
    }
    let mut out = Frame::empty(n);
    out.index = index as u64;
    out.time = index as f64 / f64::from(FPS);
    way[0] += f64::from(x[9 * n]);
    way[1] += f64::from(x[9 * n + 2]);
    out.hips = Vec3::new(way[0] as f32, x[1], way[1] as f32);
    for (local, six) in out.local.iter_mut().zip(x[3 * n..9 * n].as_chunks::<6>().0) {
        *local = rotation(six);
    }
    rig.fk(out.hips, &out.local, &mut out.global);
    let ahead = out.local[0] * Vec3::Z;
    let yaw = libm::atan2(f64::from(ahead.x), f64::from(ahead.z));
    out.root = Root { x: way[0], z: way[1], yaw };
    Ok(out)
}

/// The rotation of two columns that need not be orthonormal (Gram-Schmidt).
fn rotation(six: &[f32; 6]) -> Quat {
    let unit = |v: Vec3| v / (v.dot(v) + 1e-12).sqrt();
    let a = unit(Vec3::from_slice(&six[..3]));
    let b = Vec3::from_slice(&six[3..]);
    let b = unit(b - a.dot(b) * a);
    let q = Quat::from_mat3(&Mat3::from_cols(a, b, a.cross(b)));
    if q.is_finite() && q.length_squared() > 0.5 { q.normalize() } else { Quat::IDENTITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_become_rotations_and_what_is_none_is_unrotated_or_refused() {
        let turn = Quat::from_euler(glam::EulerRot::YXZ, 0.7, -0.3, 0.2);
        let m = Mat3::from_quat(turn);
        let mut six = [0.0; 6];
        six[..3].copy_from_slice(&(m.x_axis * 2.0).to_array());
        six[3..].copy_from_slice(&(m.y_axis * 0.5 + m.x_axis).to_array());
        assert!(rotation(&six).dot(turn).abs() > 1.0 - 1e-6);
        assert!((rotation(&[0.0; 6]).length() - 1.0).abs() < 1e-6);
        let rig = Rig::humanoid();
        let mut x = vec![0.0; motion_size(rig.len())];
        x[..3].copy_from_slice(&[7.0, 0.9, 7.0]);
        x[9 * rig.len()..][..3].copy_from_slice(&[0.5, 7.0, -0.25]);
        for six in x[3 * rig.len()..9 * rig.len()].chunks_exact_mut(6) {
            six.copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        }
        // The hips face +X.
        x[3 * rig.len()..][..6].copy_from_slice(&[0.0, 0.0, -1.0, 0.0, 1.0, 0.0]);
        let mut way = [0.5, -1.75];
        let frame = super::frame(&rig, 30, &x, &mut way).unwrap();
        assert_eq!((frame.time, frame.root.x, frame.root.z, frame.hips.y), (1.0, 1.0, -2.0, 0.9));
        assert_eq!(way, [1.0, -2.0]);
        assert!((frame.root.yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        x[40] = f32::NAN;
        assert_eq!(super::frame(&rig, 0, &x, &mut way).unwrap_err().kind(), ErrorKind::State);
    }
}
