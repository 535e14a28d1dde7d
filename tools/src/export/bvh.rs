//! Biovision hierarchy.
//!
//! Units are centimetres (metres x 100), the convention of the tools that read BVH; Y up, facing
//! +Z. Joints are named as in the rig. The root has an offset of zero and its world position in the
//! motion lines; every joint has the channels `Zrotation Xrotation Yrotation`, degrees, meaning `R
//! = Rz Rx Ry`. Angles are continuous over time, so they may exceed 180 degrees. One line per
//! frame, frame time 1/30 s.

mod euler;

use super::{atomic::write_atomically, check, tip};
use crate::recording::Recording;
use euler::Angles;
use glam::Vec3;
use std::io::{self, Write};
use std::path::Path;
use visavis::{FPS, Result, Rig};

/// Units of the file in a metre.
const SCALE: f64 = 100.0;

/// Writes the motion of the rig as BVH: centimetres, channels `Zrotation Xrotation Yrotation` (`R =
/// Rz Rx Ry`), 30 fps.
///
/// Joint positions are those of [`visavis::Frame::hips`] and [`visavis::Frame::local`] to 0.01 mm.
///
/// # Errors
/// [`visavis::ErrorKind::Argument`] if the recording has no frames, or frames that do not fit its
/// rig or are not finite; [`visavis::ErrorKind::BundleInvalid`] if the rig does not pass
/// [`Rig::check`]; [`visavis::ErrorKind::Io`] if the file cannot be written. All name `path`.
pub fn write_bvh(recording: &Recording, path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    check(recording, path)?;
    write_atomically(path, |w| write(recording, w))
}

fn write(recording: &Recording, w: &mut dyn Write) -> io::Result<()> {
    let rig = &recording.rig;
    let order = depth_first(rig);
    writeln!(w, "HIERARCHY")?;
    hierarchy(rig, 0, 0, w)?;
    writeln!(w, "MOTION\nFrames: {}\nFrame Time: {:.9}", recording.frames.len(), 1.0 / f64::from(FPS))?;
    let mut angles = vec![Angles::default(); rig.len()];
    for frame in &recording.frames {
        let p = frame.hips.as_dvec3() * SCALE;
        write!(w, "{:.5} {:.5} {:.5}", p.x, p.y, p.z)?;
        for &j in &order {
            let [z, x, y] = angles[j].follow(frame.local[j]).map(f64::to_degrees);
            write!(w, " {z:.6} {x:.6} {y:.6}")?;
        }
        writeln!(w)?;
    }
    Ok(())
}

/// Joints in the order of the hierarchy, which is that of the channels.
fn depth_first(rig: &Rig) -> Vec<usize> {
    let (mut order, mut open) = (Vec::with_capacity(rig.len()), vec![0]);
    while let Some(j) = open.pop() {
        order.push(j);
        let at = open.len();
        open.extend(rig.children(j));
        open[at..].reverse();
    }
    order
}

/// The block of joint `j` and, inside it, those below. Recursion is as deep as the rig, at most
/// 256.
fn hierarchy(rig: &Rig, j: usize, depth: usize, w: &mut dyn Write) -> io::Result<()> {
    let tab = "\t".repeat(depth);
    let name = &rig.joints[j].name;
    let (word, offset, position) = match rig.joints[j].parent {
        None => ("ROOT", Vec3::ZERO, "6 Xposition Yposition Zposition"),
        Some(_) => ("JOINT", rig.offset(j), "3"),
    };
    writeln!(w, "{tab}{word} {name}\n{tab}{{")?;
    offset_line(offset, depth + 1, w)?;
    writeln!(w, "{tab}\tCHANNELS {position} Zrotation Xrotation Yrotation")?;
    let mut leaf = true;
    for child in rig.children(j) {
        hierarchy(rig, child, depth + 1, w)?;
        leaf = false;
    }
    if leaf {
        writeln!(w, "{tab}\tEnd Site\n{tab}\t{{")?;
        offset_line(tip(rig, j), depth + 2, w)?;
        writeln!(w, "{tab}\t}}")?;
    }
    writeln!(w, "{tab}}}")
}

fn offset_line(offset: Vec3, depth: usize, w: &mut dyn Write) -> io::Result<()> {
    let o = offset.as_dvec3() * SCALE;
    writeln!(w, "{}OFFSET {:.5} {:.5} {:.5}", "\t".repeat(depth), o.x, o.y, o.z)
}

#[cfg(test)]
mod tests;
