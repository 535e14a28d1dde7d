//! The bones of the VRM 1.0 humanoid, as far as a body has them (no eyes, jaw or fingers): name,
//! parent, required.

use visavis::Rig;

/// Bones with the nearest bone that must be above them; an optional bone that is missing is skipped
/// on the way up.
const BONES: [(&str, &str, bool); 22] = [
    ("hips", "", true),
    ("spine", "hips", true),
    ("chest", "spine", false),
    ("upperChest", "chest", false),
    ("neck", "upperChest", false),
    ("head", "neck", true),
    ("leftShoulder", "upperChest", false),
    ("leftUpperArm", "leftShoulder", true),
    ("leftLowerArm", "leftUpperArm", true),
    ("leftHand", "leftLowerArm", true),
    ("rightShoulder", "upperChest", false),
    ("rightUpperArm", "rightShoulder", true),
    ("rightLowerArm", "rightUpperArm", true),
    ("rightHand", "rightLowerArm", true),
    ("leftUpperLeg", "hips", true),
    ("leftLowerLeg", "leftUpperLeg", true),
    ("leftFoot", "leftLowerLeg", true),
    ("leftToes", "leftFoot", false),
    ("rightUpperLeg", "hips", true),
    ("rightLowerLeg", "rightUpperLeg", true),
    ("rightFoot", "rightLowerLeg", true),
    ("rightToes", "rightFoot", false),
];

/// Whether this is the name of a bone of the body.
pub(super) fn is_bone(name: &str) -> bool {
    bone(name).is_some()
}

fn bone(name: &str) -> Option<&'static (&'static str, &'static str, bool)> {
    BONES.iter().find(|b| b.0 == name)
}

/// Checks required bones and that each bone's nearest bone above is the one that the humanoid has
/// there.
pub(super) fn check(rig: &Rig) -> Result<(), String> {
    for &(name, parent, required) in &BONES {
        match rig.index(name) {
            None if required => return Err(format!("it has no `{name}`")),
            None => {}
            Some(j) => {
                let (has, needs) = (bone_above(rig, j), present(rig, parent));
                if has != needs {
                    let say = |b: Option<&str>| b.map_or("nothing".to_owned(), |b| format!("`{b}`"));
                    return Err(format!("`{name}` hangs on {} and should on {}", say(has), say(needs)));
                }
            }
        }
    }
    match (rig.index("upperChest"), rig.index("chest")) {
        (Some(_), None) => Err("it has `upperChest` but no `chest`".into()),
        _ => Ok(()),
    }
}

/// The nearest joint above `j` that is a bone.
fn bone_above(rig: &Rig, j: usize) -> Option<&'static str> {
    let mut above = rig.joints[j].parent;
    while let Some(p) = above {
        if let Some(found) = bone(&rig.joints[p].name) {
            return Some(found.0);
        }
        above = rig.joints[p].parent;
    }
    None
}

/// `name`, or the nearest bone above it in the humanoid that the rig has.
fn present(rig: &Rig, name: &'static str) -> Option<&'static str> {
    let mut name = name;
    while rig.index(name).is_none() {
        name = bone(name)?.1;
    }
    Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hierarchy() {
        let rig = Rig::humanoid();
        assert_eq!(check(&rig), Ok(()));
        let with = |f: fn(&mut Rig)| {
            let mut rig = Rig::humanoid();
            f(&mut rig);
            check(&rig)
        };
        // Optional bones may be missing: joints of other names are looked through.
        assert_eq!(with(|r| r.joints[6].name = "collar".into()), Ok(()));
        assert_eq!(with(|r| r.joints[4].name = "cervical".into()), Ok(()));
        assert!(with(|r| r.joints[2].name = "ribs".into()).unwrap_err().contains("no `chest`"));
        assert!(with(|r| r.joints[15].name = "knee".into()).unwrap_err().contains("leftLowerLeg"));
        assert!(with(|r| r.joints[18].parent = Some(1)).unwrap_err().contains("`rightUpperLeg` hangs on `spine`"));
    }
}
