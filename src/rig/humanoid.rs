//! The reference rig.

use super::{Joint, Rig};

/// Name, parent (-1: none) and rest offset, metres.
type Row = (&'static str, i32, [f32; 3]);

const JOINTS: [Row; 22] = [
    ("hips", -1, [0.0, 0.92, 0.0]),
    ("spine", 0, [0.0, 0.10, -0.01]),
    ("chest", 1, [0.0, 0.12, 0.0]),
    ("upperChest", 2, [0.0, 0.12, 0.0]),
    ("neck", 3, [0.0, 0.16, 0.0]),
    ("head", 4, [0.0, 0.09, 0.015]),
    ("leftShoulder", 3, [0.03, 0.11, 0.0]),
    ("leftUpperArm", 6, [0.135, 0.0, -0.01]),
    ("leftLowerArm", 7, [0.27, 0.0, 0.0]),
    ("leftHand", 8, [0.25, 0.0, 0.0]),
    ("rightShoulder", 3, [-0.03, 0.11, 0.0]),
    ("rightUpperArm", 10, [-0.135, 0.0, -0.01]),
    ("rightLowerArm", 11, [-0.27, 0.0, 0.0]),
    ("rightHand", 12, [-0.25, 0.0, 0.0]),
    ("leftUpperLeg", 0, [0.09, -0.03, 0.0]),
    ("leftLowerLeg", 14, [0.0, -0.415, 0.0]),
    ("leftFoot", 15, [0.0, -0.40, 0.0]),
    ("leftToes", 16, [0.0, -0.05, 0.13]),
    ("rightUpperLeg", 0, [-0.09, -0.03, 0.0]),
    ("rightLowerLeg", 18, [0.0, -0.415, 0.0]),
    ("rightFoot", 19, [0.0, -0.40, 0.0]),
    ("rightToes", 20, [0.0, -0.05, 0.13]),
];

impl Rig {
    /// The reference rig: the 22 joints of the VRM humanoid that bundles use, an adult of about
    /// 1.70 m in T-pose on the floor, facing +Z, left on +X.
    pub fn humanoid() -> Self {
        let joint = |&(name, parent, offset): &Row| Joint {
            name: name.to_owned(),
            parent: usize::try_from(parent).ok(),
            offset,
        };
        Self { joints: JOINTS.iter().map(joint).collect(), eyes: [0.0, 0.07, 0.09], head_back: [0.0, 0.07, -0.10] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Transform;
    use glam::{Quat, Vec3};

    #[test]
    fn stands_on_the_floor_as_an_adult() {
        let rig = Rig::humanoid();
        rig.check().unwrap();
        let mut out = vec![Transform::IDENTITY; rig.len()];
        rig.fk(rig.offset(0), &vec![Quat::IDENTITY; rig.len()], &mut out);
        let at = |name: &str| out[rig.index(name).unwrap()].position;
        assert!((0.0..0.05).contains(&at("leftToes").y));
        assert!((1.5..1.6).contains(&rig.head_points(&out[5]).0.y), "eye height of a person of 1.70 m");
        assert!(at("leftHand").x > 0.6 && at("leftToes").z > 0.1);
        for (j, t) in out.iter().enumerate() {
            let name = &rig.joints[j].name;
            let Some(side) = name.strip_prefix("left") else { continue };
            let mirrored = at(&format!("right{side}"));
            assert!(mirrored.distance(t.position * Vec3::new(-1.0, 1.0, 1.0)) < 1e-6, "{name}");
        }
    }
}
