//! Writers of a [`Recording`]: BVH, glTF binary and VRM animation.
//!
//! | file | for | holds |
//! |---|---|---|
//! | `.bvh` ([`write_bvh`]) | animation tools | the skeleton, centimetres, Euler angles |
//! | `.glb` ([`write_gltf`]) | any glTF viewer | a simple body on the skeleton, animated, and the user's head |
//! | `.vrma` ([`write_vrma`]) | VRM avatars | the skeleton mapped to the VRM humanoid, animated |
//!
//! All of them hold the motion of the fixed-bone-length rig ([`visavis::Frame::hips`] and
//! [`visavis::Frame::local`]), at 30 fps from time 0. A file appears whole or not at all
//! ([`write_atomically`]).

mod atomic;
mod bvh;
mod gltf;
pub(crate) mod replace;
#[cfg(test)]
pub(crate) mod scratch;
pub mod viewer;
mod vrma;

pub use atomic::write_atomically;
pub use bvh::write_bvh;
pub use gltf::write_gltf;
pub use vrma::write_vrma;

use crate::recording::Recording;
use glam::Vec3;
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Result, Rig};

/// Writes `motion.bvh`, `motion.glb` and `motion.vrma` into the folder `dir`, which is made if it
/// is missing, and returns their paths in this order.
///
/// # Errors
/// [`ErrorKind::Io`] if the folder cannot be made; those of the writers.
pub fn write_motion(recording: &Recording, dir: impl AsRef<Path>) -> Result<[PathBuf; 3]> {
    let dir = dir.as_ref();
    std::fs::create_dir_all(dir).map_err(|e| Error::io("make the output folder", dir, e))?;
    let paths = ["motion.bvh", "motion.glb", "motion.vrma"].map(|name| dir.join(name));
    write_bvh(recording, &paths[0])?;
    write_gltf(recording, &paths[1])?;
    write_vrma(recording, &paths[2])?;
    Ok(paths)
}

/// What every writer needs of a recording; the error names `path`, the file that was to be written.
fn check(recording: &Recording, path: &Path) -> Result<()> {
    let bad = |message: String| Err(Error::new(ErrorKind::Argument, message).with_path(path));
    recording.rig.check().map_err(|e| e.with_path(path))?;
    if recording.frames.is_empty() {
        return bad("the recording has no frames; generate at least one block before exporting".into());
    }
    if recording.user.len() != recording.frames.len() {
        let (users, frames) = (recording.user.len(), recording.frames.len());
        return bad(format!("the recording has {frames} frames but {users} user positions; give one a frame"));
    }
    if recording.user.iter().flatten().any(|p| !p.is_finite()) {
        return bad("a user position of the recording is not finite; leave it out as `None`".into());
    }
    for (i, frame) in recording.frames.iter().enumerate() {
        if frame.local.len() != recording.rig.len() {
            let (has, needs) = (frame.local.len(), recording.rig.len());
            return bad(format!("frame {i} has {has} local rotations but the rig has {needs} joints"));
        }
        let unit = |q: &glam::Quat| (q.length_squared() - 1.0).abs() < 1e-3;
        if !frame.hips.is_finite() || !frame.local.iter().all(unit) {
            return bad(format!("frame {i} holds a position or rotation that is not finite or not a unit quaternion"));
        }
    }
    Ok(())
}

/// Where the body ends beyond a joint without children, in the joint's frame, metres: crown, finger
/// tips, toe tips.
fn tip(rig: &Rig, j: usize) -> Vec3 {
    let along = rig.offset(j).normalize_or(Vec3::Y);
    match rig.joints[j].name.as_str() {
        "head" => Vec3::Y * (rig.eyes[1] + 0.11),
        "leftHand" | "rightHand" => along * 0.17,
        "leftToes" | "rightToes" => Vec3::Z * 0.06,
        _ => along * 0.05,
    }
}

#[cfg(test)]
mod tests {
    use super::scratch::Scratch;
    use super::*;
    use crate::synthetic::walk;

    fn kind_of_all(recording: &Recording) -> Vec<ErrorKind> {
        let dir = Scratch::new("refused");
        let path = dir.path("motion.any");
        let writers: [fn(&Recording, &Path) -> Result<()>; 3] =
            [|r, p| write_bvh(r, p), |r, p| write_gltf(r, p), |r, p| write_vrma(r, p)];
        let kinds = writers
            .map(|write| {
                let e = write(recording, &path).expect_err("must be refused");
                assert_eq!(e.path(), Some(path.as_path()), "{e}");
                e.kind()
            })
            .to_vec();
        assert!(dir.is_empty(), "something was left behind");
        kinds
    }

    #[test]
    fn refuses_what_cannot_be_exported() {
        let broken = |f: fn(&mut Recording)| {
            let mut recording = walk(3);
            f(&mut recording);
            let kinds = kind_of_all(&recording);
            assert!(kinds.iter().all(|k| *k == kinds[0]));
            kinds[0]
        };
        assert_eq!(broken(|r| r.frames.clear()), ErrorKind::Argument);
        assert_eq!(broken(|r| r.user.truncate(1)), ErrorKind::Argument);
        assert_eq!(broken(|r| r.user[2] = Some(Vec3::NAN)), ErrorKind::Argument);
        assert_eq!(broken(|r| r.frames[1].local.truncate(5)), ErrorKind::Argument);
        assert_eq!(broken(|r| r.frames[1].local[4] *= 0.5), ErrorKind::Argument);
        assert_eq!(broken(|r| r.frames[2].hips.x = f32::INFINITY), ErrorKind::Argument);
        assert_eq!(broken(|r| r.rig.joints[5].name = "skull".into()), ErrorKind::BundleInvalid);
    }

    #[test]
    fn writes_a_folder() {
        // With VISAVIS_EXPORT_DIR the files stay there, for tests/validate_gltf.
        let scratch = Scratch::new("folder");
        let dir = std::env::var_os("VISAVIS_EXPORT_DIR").map_or_else(|| scratch.path("a/b"), PathBuf::from);
        let paths = write_motion(&walk(240), &dir).unwrap();
        for path in &paths {
            assert!(std::fs::metadata(path).unwrap().len() > 10_000, "{}", path.display());
        }
        // Overwriting, and a folder that is a file.
        write_motion(&walk(240), &dir).unwrap();
        let e = write_motion(&walk(1), &paths[0]).unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(paths[0].as_path())));
    }
}
