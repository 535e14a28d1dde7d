use super::pose::{orthonormalise, per_joint};
use super::*;
use crate::frame::{Root, Transform};
use crate::rig::Rig;
use glam::{Quat, Vec3};

/// A pose of small rotations.
fn pose(joints: usize) -> Vec<f32> {
    let mut y = vec![0.01, -0.02, 0.03, 0.95];
    for j in 0..joints {
        let turn = glam::Mat3::from_quat(Quat::from_euler(glam::EulerRot::YXZ, 0.1 * j as f32, 0.3, -0.02 * j as f32));
        y.extend(turn.x_axis.to_array().into_iter().chain(turn.y_axis.to_array()));
    }
    y
}

#[test]
fn poses_survive_the_round_trip() {
    let rig = Rig::humanoid();
    let (bones, y) = (Bones::new(&rig), pose(rig.len()));
    let (mut joints, mut back) = (vec![Transform::IDENTITY; rig.len()], vec![0.0; y.len()]);
    bones.place(&y, &mut joints);
    for (j, joint) in rig.joints.iter().enumerate().filter_map(|(j, joint)| Some((j, joint.parent?))) {
        let length = joints[j].position.distance(joints[joint].position);
        assert!((length - rig.offset(j).length()).abs() < 1e-6, "bone {j}");
    }
    bones.read(&joints, [y[0], y[1], y[2]], &mut back);
    let error = y.iter().zip(&back).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(error < 1e-5, "{error}");
}

#[test]
fn columns_become_orthonormal_and_rows_of_zeros_stay_finite() {
    let mut y = pose(2);
    y[LEAD..].iter_mut().enumerate().for_each(|(i, v)| *v = 3.0 * *v + 0.01 * i as f32);
    orthonormalise(&mut y);
    for six in y[LEAD..].as_chunks::<6>().0 {
        let (a, b) = (Vec3::from_slice(&six[..3]), Vec3::from_slice(&six[3..]));
        assert!((a.length() - 1.0).abs() < 1e-6 && (b.length() - 1.0).abs() < 1e-6 && a.dot(b).abs() < 1e-6);
    }
    y[LEAD..].fill(0.0);
    orthonormalise(&mut y);
    assert!(y.iter().all(|v| v.is_finite()));
}

#[test]
fn joints_have_the_mean_of_their_numbers_and_the_hips_the_roots_too() {
    let delta: Vec<f32> = (0..pose_size(2)).map(|i| i as f32).collect();
    let mut joints = [0.0; 2];
    per_joint(&delta, &mut joints);
    assert_eq!(joints, [4.5, 12.5]);
}

#[test]
fn the_users_row_is_in_the_agents_frame_and_zero_where_nothing_is_known() {
    let root = Root { x: 1.0, z: -2.0, yaw: std::f64::consts::FRAC_PI_2 };
    let ahead = Some(Vec3::new(3.0, 1.7, -2.0));
    // The agent faces +X; the user, two metres ahead, faces back.
    let rotation = Some(Quat::from_rotation_y(-std::f32::consts::FRAC_PI_2));
    let row = Seen { head: ahead, rotation, gaze: Some(0.4) }.row(&root);
    let want = [0.0, 1.0, 0.1, 0.0, 0.998_752_3, 0.0, 0.0, -1.0, 1.0, 1.0, 0.4, 1.0];
    assert!(row.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-5), "{row:?}");
    assert_eq!(Seen::default().row(&root), [0.0; USER]);
    assert_eq!(Seen { rotation, ..Seen::default() }.row(&root), [0.0; USER], "no rotation without a place");
    assert_eq!(Seen { head: ahead, ..Seen::default() }.row(&root)[5..], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
}
