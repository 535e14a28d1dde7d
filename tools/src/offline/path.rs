//! A recorded path as a tracker would have sent it.

use crate::offline::UserPath;
use glam::{Quat, Vec3};
use visavis::internals::user::{HOLD_SECONDS, TELEPORT_SPEED};

/// Positions further apart in time than this are filled in, seconds; head trackers send 72 to 120
/// positions a second.
const SPARSE: f64 = 1.0 / 60.0;
/// Rate at which they are filled in, Hz.
const RATE: f64 = 90.0;

/// The points of `path` (seconds, metres) for a session, which never looks ahead: between the
/// points of a slow recording it would hold each position until the next one comes. So where
/// neighbours are more than 1/60 s apart, positions at 90 Hz or more are put in between, in a
/// straight line. Gaps of more than half a second and jumps faster than 12 m/s stay as they are,
/// for the session to judge.
pub fn for_session(path: &UserPath) -> Vec<(f64, Vec3)> {
    poses_for_session(path).into_iter().map(|(time, position, _)| (time, position)).collect()
}

/// As [`for_session`], with rotations where the path has them, in between the shorter way.
pub(super) fn poses_for_session(path: &UserPath) -> Vec<(f64, Vec3, Option<Quat>)> {
    let points = path.points();
    let rotation = |i: usize| path.rotations().get(i).copied();
    let mut out = Vec::with_capacity(points.len());
    for (i, pair) in points.windows(2).enumerate() {
        let ((t0, p0), (t1, p1)) = (pair[0], pair[1]);
        let (r0, r1) = (rotation(i), rotation(i + 1));
        out.push((t0, p0, r0));
        let gap = t1 - t0;
        // A ten-thousandth of tolerance: 60 Hz written with six decimals is not sparse.
        if gap <= SPARSE * 1.0001 || gap > HOLD_SECONDS || f64::from(p0.distance(p1)) > f64::from(TELEPORT_SPEED) * gap
        {
            continue;
        }
        let steps = (gap * RATE).ceil() as u32;
        out.extend((1..steps).map(|i| {
            let part = f64::from(i) / f64::from(steps);
            let rotation = r0.zip(r1).map(|(a, b)| a.lerp(b, part as f32));
            (t0 + part * gap, p0.lerp(p1, part as f32), rotation)
        }));
    }
    out.extend(points.last().map(|&(time, position)| (time, position, rotation(points.len() - 1))));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(text: &str) -> Vec<(f64, Vec3)> {
        for_session(&UserPath::parse(&format!("t,x,y,z\n{text}")).unwrap())
    }

    #[test]
    fn slow_recordings_are_filled_in() {
        let points = filled("0,0,1,0\n0.1,0.5,1,0\n0.2,0.5,1,1\n");
        assert_eq!(points.len(), 19);
        assert!(points.windows(2).all(|w| w[1].0 > w[0].0 && w[1].0 - w[0].0 < 1.0 / 89.0));
        for (t, p) in &points[..10] {
            assert!((p.x - 5.0 * *t as f32).abs() < 1e-5 && p.z == 0.0, "{t} {p}");
        }
        assert_eq!(points[9], (0.1, Vec3::new(0.5, 1.0, 0.0)));
        assert_eq!(points[18], (0.2, Vec3::new(0.5, 1.0, 1.0)));
    }

    #[test]
    fn rotations_are_filled_in_too() {
        let path = UserPath::parse("t,x,y,z\n0,0,1,0\n0.1,0,1,0\n").unwrap();
        assert!(path.clone().with_rotations(vec![Quat::IDENTITY]).is_err());
        assert!(path.clone().with_rotations(vec![Quat::from_xyzw(0.0, 0.0, 0.0, 2.0); 2]).is_err());
        assert!(poses_for_session(&path).iter().all(|(.., rotation)| rotation.is_none()));
        let path = path.with_rotations(vec![Quat::IDENTITY, -Quat::from_rotation_x(0.2)]).unwrap();
        let poses = poses_for_session(&path);
        let pitch = |i: usize| poses[i].2.map(|r: Quat| 2.0 * (r.x / r.w).atan()).unwrap();
        assert_eq!(poses.len(), 10);
        assert!(pitch(0).abs() < 1e-6 && (pitch(9) - 0.2).abs() < 1e-5 && (pitch(5) - 0.2 * 5.0 / 9.0).abs() < 1e-3);
    }

    #[test]
    fn fast_recordings_gaps_and_jumps_stay() {
        for text in
            ["0,0,1,0\n0.016667,0,1,0\n0.033333,0,1,0\n", "0,0,1,0\n0.6,0,1,0\n", "0,0,1,0\n0.1,5,1,0\n", "0,0,1,0\n"]
        {
            assert_eq!(filled(text), UserPath::parse(&format!("t,x,y,z\n{text}")).unwrap().points(), "{text}");
        }
    }
}
