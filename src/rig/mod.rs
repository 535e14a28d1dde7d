//! The skeleton of a bundle.

mod humanoid;

use crate::error::{Error, ErrorKind, Result};
use crate::frame::Transform;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// Most joints that a rig may have.
pub const MAX_JOINTS: usize = 256;
/// No offset of a rig may be longer than this, metres: a rig in centimetres is refused.
const MAX_OFFSET: f32 = 3.0;
/// Joints that the runtime needs by name: gaze, contacts, metrics.
const NEEDED: [&str; 6] = ["hips", "head", "leftHand", "rightHand", "leftFoot", "rightFoot"];

/// One joint of a [`Rig`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// VRM humanoid bone name.
    pub name: String,
    /// Index of the parent, smaller than the joint's own; `None` for the hips.
    pub parent: Option<usize>,
    /// Rest offset from the parent, metres; for the hips their height above the floor.
    pub offset: [f32; 3],
}

/// The skeleton: joints with parents before children.
///
/// At rest it stands in a T-pose facing +Z, all rotations identity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// Joints, parents before children.
    pub joints: Vec<Joint>,
    /// Midpoint of the eyes in the head joint's frame, metres (the front of the head, `h_f`).
    pub eyes: [f32; 3],
    /// Back of the head in the head joint's frame, metres (`h_b`).
    pub head_back: [f32; 3],
}

impl Rig {
    /// Checks that the rig can be used: 1 to 256 joints, `hips` first and the only root, parents
    /// before children, unique non-empty names, finite offsets of at most 3 m, a distance between
    /// `eyes` and `head_back`, and the joints `hips`, `head`, both hands and both feet.
    ///
    /// # Errors
    /// [`ErrorKind::BundleInvalid`] naming the joint and what is wrong with it.
    pub fn check(&self) -> Result<()> {
        let n = self.joints.len();
        if n == 0 || n > MAX_JOINTS {
            return Err(invalid(format!("the rig has {n} joints; it needs 1 to {MAX_JOINTS}")));
        }
        for (j, joint) in self.joints.iter().enumerate() {
            self.check_joint(j, joint)?;
        }
        if let Some(name) = NEEDED.iter().find(|name| self.index(name).is_none()) {
            return Err(invalid(format!("the rig has no joint `{name}`; name its joints after the VRM humanoid")));
        }
        for (what, point) in [("eyes", self.eyes), ("head_back", self.head_back)] {
            check_offset(point).map_err(|why| invalid(format!("the rig's `{what}` point {why}")))?;
        }
        if Vec3::from(self.eyes).distance(Vec3::from(self.head_back)) < 0.01 {
            return Err(invalid("the rig's `eyes` and `head_back` are the same point; the gaze needs a direction"));
        }
        Ok(())
    }

    fn check_joint(&self, j: usize, joint: &Joint) -> Result<()> {
        let name = &joint.name;
        if name.is_empty() || name.contains(|c: char| c.is_whitespace() || c.is_control()) {
            return Err(invalid(format!("joint {j} of the rig has the name {name:?}; it must be one plain word")));
        }
        if self.index(name) != Some(j) {
            return Err(invalid(format!("the rig has two joints named `{name}`")));
        }
        match joint.parent {
            None if j > 0 => return Err(invalid(format!("joint `{name}` has no parent; only the hips may have none"))),
            Some(p) if p >= j => {
                return Err(invalid(format!("joint `{name}` ({j}) has parent {p}; parents come before children")));
            }
            _ => {}
        }
        if j == 0 && name != "hips" {
            return Err(invalid(format!("the first joint of the rig is `{name}`; it must be `hips`")));
        }
        check_offset(joint.offset).map_err(|why| invalid(format!("the offset of joint `{name}` {why}")))
    }

    /// Number of joints, J.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether the rig has no joints (such a rig does not pass [`Rig::check`]).
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Index of the joint of this name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| j.name == name)
    }

    /// Rest offset of joint `j` from its parent, metres.
    ///
    /// # Panics
    /// If `j` is not below [`Rig::len`].
    pub fn offset(&self, j: usize) -> Vec3 {
        Vec3::from(self.joints[j].offset)
    }

    /// Indices of the children of joint `j`, ascending.
    pub fn children(&self, j: usize) -> impl Iterator<Item = usize> + '_ {
        self.joints.iter().enumerate().filter(move |(_, c)| c.parent == Some(j)).map(|(i, _)| i)
    }

    /// Forward kinematics on the fixed bone lengths: `out[j]` is the transform of joint `j` in the
    /// frame of `hips` (the hips' position, metres) and `local` (rotations relative to the parent,
    /// J of them).
    ///
    /// # Panics
    /// If `local` or `out` is not J long.
    pub fn fk(&self, hips: Vec3, local: &[Quat], out: &mut [Transform]) {
        assert_eq!(local.len(), self.len(), "one local rotation a joint");
        assert_eq!(out.len(), self.len(), "one transform a joint");
        for (j, joint) in self.joints.iter().enumerate() {
            out[j] = match joint.parent {
                None => Transform { position: hips, rotation: local[j] },
                Some(p) => {
                    let Transform { position, rotation } = out[p];
                    Transform { position: position + rotation * self.offset(j), rotation: rotation * local[j] }
                }
            };
        }
    }

    /// Where the eyes' midpoint (`h_f`) and the back of the head (`h_b`) are, given the head
    /// joint's transform.
    pub fn head_points(&self, head: &Transform) -> (Vec3, Vec3) {
        let place = |p: [f32; 3]| head.position + head.rotation * Vec3::from(p);
        (place(self.eyes), place(self.head_back))
    }
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::BundleInvalid, message)
}

fn check_offset(offset: [f32; 3]) -> Result<(), String> {
    let v = Vec3::from(offset);
    if !v.is_finite() {
        return Err(format!("is {offset:?}; it must be finite"));
    }
    if v.length() > MAX_OFFSET {
        return Err(format!("is {:.1} m long; offsets are in metres, at most {MAX_OFFSET} m", v.length()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn broken(f: impl FnOnce(&mut Rig)) -> String {
        let mut rig = Rig::humanoid();
        f(&mut rig);
        let e = rig.check().expect_err("must be refused");
        assert_eq!(e.kind(), ErrorKind::BundleInvalid);
        e.to_string()
    }

    #[test]
    fn refuses_what_cannot_be_used() {
        assert!(broken(|r| r.joints.clear()).contains("0 joints"));
        assert!(broken(|r| r.joints[3].parent = Some(3)).contains("parents come before"));
        assert!(broken(|r| r.joints[3].parent = Some(99)).contains("parents come before"));
        assert!(broken(|r| r.joints[3].parent = None).contains("only the hips"));
        assert!(broken(|r| r.joints[0].name = "root".into()).contains("must be `hips`"));
        assert!(broken(|r| r.joints[5].name = "skull".into()).contains("no joint `head`"));
        assert!(broken(|r| r.joints[5].name = "neck".into()).contains("two joints named `neck`"));
        assert!(broken(|r| r.joints[5].name = "a b".into()).contains("plain word"));
        assert!(broken(|r| r.joints[8].offset[1] = f32::NAN).contains("finite"));
        assert!(broken(|r| r.joints[8].offset[0] = 27.0).contains("metres"));
        assert!(broken(|r| r.eyes = r.head_back).contains("same point"));
        assert!(broken(|r| r.eyes[2] = f32::INFINITY).contains("`eyes`"));
        let joint = Rig::humanoid().joints[1].clone();
        assert!(broken(|r| r.joints.resize(MAX_JOINTS + 1, joint)).contains("257 joints"));
    }

    #[test]
    fn kinematics_of_a_quarter_turn() {
        let rig = Rig::humanoid();
        let mut local = vec![Quat::IDENTITY; rig.len()];
        local[0] = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let mut out = vec![Transform::IDENTITY; rig.len()];
        rig.fk(Vec3::new(1.0, 2.0, 3.0), &local, &mut out);
        // A body that faces +X has its left hand (rest: +X) towards -Z.
        let hand = out[rig.index("leftHand").unwrap()].position;
        assert!(hand.z < 3.0 - 0.6 && (hand.x - 0.98).abs() < 1e-5, "{hand}");
        let (front, back) = rig.head_points(&out[rig.index("head").unwrap()]);
        assert!(front.x > back.x + 0.1 && (front.z - back.z).abs() < 1e-5);
    }
}
