//! Joints of OpenXR's body tracking extensions and of the VRM humanoid, to and fro.
//!
//! `XR_FB_body_tracking` has 70 joints (`XrBodyJointFB`): spine, arms, and both hands to the finger
//! tips; `XR_META_body_tracking_full_body` has the same and 14 more of the legs
//! (`XrFullBodyJointMETA`). Index `i` of [`OPENXR_JOINTS`] is the extension's own number, its name
//! without prefix and suffix (`HIPS` for `XR_BODY_JOINT_HIPS_FB`).

/// Joints of `XR_FB_body_tracking`: the first of [`OPENXR_JOINTS`].
pub const FB_BODY_JOINTS: usize = 70;

/// Joints of `XR_META_body_tracking_full_body`, and the VRM joint whose transform each follows: its
/// own, or the nearest one towards the hips (palms and fingers follow the hand). `ROOT` follows
/// none: it is the agent's place on the floor.
pub const OPENXR_JOINTS: [(&str, Option<&str>); 84] = [
    ("ROOT", None),
    ("HIPS", Some("hips")),
    ("SPINE_LOWER", Some("spine")),
    ("SPINE_MIDDLE", Some("spine")),
    ("SPINE_UPPER", Some("chest")),
    ("CHEST", Some("upperChest")),
    ("NECK", Some("neck")),
    ("HEAD", Some("head")),
    ("LEFT_SHOULDER", Some("leftShoulder")),
    ("LEFT_SCAPULA", Some("leftShoulder")),
    ("LEFT_ARM_UPPER", Some("leftUpperArm")),
    ("LEFT_ARM_LOWER", Some("leftLowerArm")),
    ("LEFT_HAND_WRIST_TWIST", Some("leftLowerArm")),
    ("RIGHT_SHOULDER", Some("rightShoulder")),
    ("RIGHT_SCAPULA", Some("rightShoulder")),
    ("RIGHT_ARM_UPPER", Some("rightUpperArm")),
    ("RIGHT_ARM_LOWER", Some("rightLowerArm")),
    ("RIGHT_HAND_WRIST_TWIST", Some("rightLowerArm")),
    ("LEFT_HAND_PALM", Some("leftHand")),
    ("LEFT_HAND_WRIST", Some("leftHand")),
    ("LEFT_HAND_THUMB_METACARPAL", Some("leftHand")),
    ("LEFT_HAND_THUMB_PROXIMAL", Some("leftHand")),
    ("LEFT_HAND_THUMB_DISTAL", Some("leftHand")),
    ("LEFT_HAND_THUMB_TIP", Some("leftHand")),
    ("LEFT_HAND_INDEX_METACARPAL", Some("leftHand")),
    ("LEFT_HAND_INDEX_PROXIMAL", Some("leftHand")),
    ("LEFT_HAND_INDEX_INTERMEDIATE", Some("leftHand")),
    ("LEFT_HAND_INDEX_DISTAL", Some("leftHand")),
    ("LEFT_HAND_INDEX_TIP", Some("leftHand")),
    ("LEFT_HAND_MIDDLE_METACARPAL", Some("leftHand")),
    ("LEFT_HAND_MIDDLE_PROXIMAL", Some("leftHand")),
    ("LEFT_HAND_MIDDLE_INTERMEDIATE", Some("leftHand")),
    ("LEFT_HAND_MIDDLE_DISTAL", Some("leftHand")),
    ("LEFT_HAND_MIDDLE_TIP", Some("leftHand")),
    ("LEFT_HAND_RING_METACARPAL", Some("leftHand")),
    ("LEFT_HAND_RING_PROXIMAL", Some("leftHand")),
    ("LEFT_HAND_RING_INTERMEDIATE", Some("leftHand")),
    ("LEFT_HAND_RING_DISTAL", Some("leftHand")),
    ("LEFT_HAND_RING_TIP", Some("leftHand")),
    ("LEFT_HAND_LITTLE_METACARPAL", Some("leftHand")),
    ("LEFT_HAND_LITTLE_PROXIMAL", Some("leftHand")),
    ("LEFT_HAND_LITTLE_INTERMEDIATE", Some("leftHand")),
    ("LEFT_HAND_LITTLE_DISTAL", Some("leftHand")),
    ("LEFT_HAND_LITTLE_TIP", Some("leftHand")),
    ("RIGHT_HAND_PALM", Some("rightHand")),
    ("RIGHT_HAND_WRIST", Some("rightHand")),
    ("RIGHT_HAND_THUMB_METACARPAL", Some("rightHand")),
    ("RIGHT_HAND_THUMB_PROXIMAL", Some("rightHand")),
    ("RIGHT_HAND_THUMB_DISTAL", Some("rightHand")),
    ("RIGHT_HAND_THUMB_TIP", Some("rightHand")),
    ("RIGHT_HAND_INDEX_METACARPAL", Some("rightHand")),
    ("RIGHT_HAND_INDEX_PROXIMAL", Some("rightHand")),
    ("RIGHT_HAND_INDEX_INTERMEDIATE", Some("rightHand")),
    ("RIGHT_HAND_INDEX_DISTAL", Some("rightHand")),
    ("RIGHT_HAND_INDEX_TIP", Some("rightHand")),
    ("RIGHT_HAND_MIDDLE_METACARPAL", Some("rightHand")),
    ("RIGHT_HAND_MIDDLE_PROXIMAL", Some("rightHand")),
    ("RIGHT_HAND_MIDDLE_INTERMEDIATE", Some("rightHand")),
    ("RIGHT_HAND_MIDDLE_DISTAL", Some("rightHand")),
    ("RIGHT_HAND_MIDDLE_TIP", Some("rightHand")),
    ("RIGHT_HAND_RING_METACARPAL", Some("rightHand")),
    ("RIGHT_HAND_RING_PROXIMAL", Some("rightHand")),
    ("RIGHT_HAND_RING_INTERMEDIATE", Some("rightHand")),
    ("RIGHT_HAND_RING_DISTAL", Some("rightHand")),
    ("RIGHT_HAND_RING_TIP", Some("rightHand")),
    ("RIGHT_HAND_LITTLE_METACARPAL", Some("rightHand")),
    ("RIGHT_HAND_LITTLE_PROXIMAL", Some("rightHand")),
    ("RIGHT_HAND_LITTLE_INTERMEDIATE", Some("rightHand")),
    ("RIGHT_HAND_LITTLE_DISTAL", Some("rightHand")),
    ("RIGHT_HAND_LITTLE_TIP", Some("rightHand")),
    ("LEFT_UPPER_LEG", Some("leftUpperLeg")),
    ("LEFT_LOWER_LEG", Some("leftLowerLeg")),
    ("LEFT_FOOT_ANKLE_TWIST", Some("leftLowerLeg")),
    ("LEFT_FOOT_ANKLE", Some("leftFoot")),
    ("LEFT_FOOT_SUBTALAR", Some("leftFoot")),
    ("LEFT_FOOT_TRANSVERSE", Some("leftFoot")),
    ("LEFT_FOOT_BALL", Some("leftToes")),
    ("RIGHT_UPPER_LEG", Some("rightUpperLeg")),
    ("RIGHT_LOWER_LEG", Some("rightLowerLeg")),
    ("RIGHT_FOOT_ANKLE_TWIST", Some("rightLowerLeg")),
    ("RIGHT_FOOT_ANKLE", Some("rightFoot")),
    ("RIGHT_FOOT_SUBTALAR", Some("rightFoot")),
    ("RIGHT_FOOT_TRANSVERSE", Some("rightFoot")),
    ("RIGHT_FOOT_BALL", Some("rightToes")),
];

/// The OpenXR joint that stands for the VRM joint `name`; `None` for a joint that has no
/// counterpart. Leg joints have numbers from 70 on and exist in `XR_META_body_tracking_full_body`
/// only.
pub fn openxr_joint(name: &str) -> Option<usize> {
    let (side, joint) = match name.strip_prefix("left") {
        Some(joint) => (0, joint),
        None => (1, name.strip_prefix("right").unwrap_or("")),
    };
    let pick = |of: [usize; 2]| Some(of[side]);
    match (name, joint) {
        ("hips", _) => Some(1),
        ("spine", _) => Some(2),
        ("chest", _) => Some(4),
        ("upperChest", _) => Some(5),
        ("neck", _) => Some(6),
        ("head", _) => Some(7),
        (_, "Shoulder") => pick([8, 13]),
        (_, "UpperArm") => pick([10, 15]),
        (_, "LowerArm") => pick([11, 16]),
        (_, "Hand") => pick([19, 45]),
        (_, "UpperLeg") => pick([70, 77]),
        (_, "LowerLeg") => pick([71, 78]),
        (_, "Foot") => pick([73, 80]),
        (_, "Toes") => pick([76, 83]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Rig;
    use super::*;

    #[test]
    fn every_joint_of_the_rig_has_a_counterpart_that_follows_it() {
        let rig = Rig::humanoid();
        for joint in &rig.joints {
            let index = openxr_joint(&joint.name).unwrap_or_else(|| panic!("{}", joint.name));
            assert_eq!(OPENXR_JOINTS[index].1, Some(joint.name.as_str()), "{}", OPENXR_JOINTS[index].0);
        }
        for (name, follows) in &OPENXR_JOINTS[1..] {
            assert!(follows.is_some_and(|f| rig.index(f).is_some()), "{name} follows {follows:?}");
        }
        assert_eq!(openxr_joint("jaw"), None);
        assert_eq!(openxr_joint("leftEye"), None);
    }

    #[test]
    fn numbers_are_the_extensions_own() {
        let at = |i: usize| OPENXR_JOINTS[i].0;
        assert_eq!((at(0), at(17), at(18)), ("ROOT", "RIGHT_HAND_WRIST_TWIST", "LEFT_HAND_PALM"));
        assert_eq!((at(19), at(23), at(43)), ("LEFT_HAND_WRIST", "LEFT_HAND_THUMB_TIP", "LEFT_HAND_LITTLE_TIP"));
        assert_eq!((at(44), at(45), at(69)), ("RIGHT_HAND_PALM", "RIGHT_HAND_WRIST", "RIGHT_HAND_LITTLE_TIP"));
        assert_eq!((at(70), at(73), at(76)), ("LEFT_UPPER_LEG", "LEFT_FOOT_ANKLE", "LEFT_FOOT_BALL"));
        assert_eq!((at(77), at(83)), ("RIGHT_UPPER_LEG", "RIGHT_FOOT_BALL"));
        let mut names: Vec<_> = OPENXR_JOINTS.iter().map(|j| j.0).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), OPENXR_JOINTS.len());
        assert!(OPENXR_JOINTS[..FB_BODY_JOINTS].iter().all(|j| !j.0.contains("LEG") && !j.0.contains("FOOT")));
    }
}
