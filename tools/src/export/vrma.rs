//! VRM animation: glTF binary with the extension `VRMC_vrm_animation` 1.0.
//!
//! The file has the skeleton's nodes at rest (T-pose, facing +Z, no rotations), the map from VRM
//! humanoid bones to nodes and the animation: translation of the hips and rotation of every mapped
//! joint. Where the gaze goes is in the head's rotation; the file has no `lookAt`, since the motion
//! has no eyes of its own.

mod humanoid;

use super::gltf::{animate, builder::Builder};
use super::{atomic::write_atomically, check};
use crate::recording::Recording;
use gltf_json::extensions::root::Root as Extensions;
use gltf_json::{Index, Node};
use serde_json::{Map, Value, json};
use std::path::Path;
use visavis::{Error, ErrorKind, Result, Rig};

/// Name of the extension, version 1.0.
const EXTENSION: &str = "VRMC_vrm_animation";

/// Writes the motion of the rig as a `.vrma` (VRM animation 1.0) for VRM avatars: metres, 30 fps
/// from time 0.
///
/// Joints whose names are not VRM humanoid bones are in the file but not mapped.
///
/// # Errors
/// As [`super::write_bvh`]; also [`ErrorKind::Argument`] if the rig lacks a bone that the VRM
/// humanoid requires (hips, spine, head, upper and lower arms, hands, upper and lower legs, feet)
/// or its hierarchy is not that of the humanoid.
pub fn write_vrma(recording: &Recording, path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    check(recording, path)?;
    let vrma = vrma(recording).map_err(|e| e.with_path(path))?;
    write_atomically(path, |w| w.write_all(&vrma))
}

fn vrma(recording: &Recording) -> Result<Vec<u8>> {
    let rig = &recording.rig;
    humanoid::check(rig).map_err(|why| {
        Error::new(
            ErrorKind::Argument,
            format!("the rig is not a VRM humanoid: {why}; export it as BVH or glTF instead"),
        )
    })?;
    let mut builder = Builder::new("visavis motion");
    let joints = builder.skeleton(rig);
    animate(&mut builder, recording, &joints, None);
    builder.scene(vec![joints[0]]);
    builder.root.extensions_used.push(EXTENSION.into());
    builder.root.extensions = Some(Extensions { others: extension(rig, &joints) });
    builder.finish()
}

fn extension(rig: &Rig, joints: &[Index<Node>]) -> Map<String, Value> {
    let bone = |(joint, node): (&visavis::Joint, &Index<Node>)| {
        humanoid::is_bone(&joint.name).then(|| (joint.name.clone(), json!({ "node": node.value() })))
    };
    let bones: Map<String, Value> = rig.joints.iter().zip(joints).filter_map(bone).collect();
    let extension = json!({ "specVersion": "1.0", "humanoid": { "humanBones": bones } });
    [(EXTENSION.to_owned(), extension)].into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::super::gltf::tests::{Glb, assert_plays};
    use super::*;
    use crate::synthetic::walk;

    #[test]
    fn maps_the_humanoid_and_plays() {
        let recording = walk(30);
        let glb = Glb::parse(&vrma(&recording).unwrap());
        assert_plays(&glb, &recording);
        assert_eq!(glb.json["extensionsUsed"], json!([EXTENSION]));
        let extension = &glb.json["extensions"][EXTENSION];
        assert_eq!(extension["specVersion"], "1.0");
        let bones = extension["humanoid"]["humanBones"].as_object().unwrap();
        assert_eq!(bones.len(), 22);
        for (name, bone) in bones {
            assert_eq!(bone["node"].as_u64().unwrap() as usize, glb.node(name).unwrap());
        }
        // Only the hips move; nothing is rotated at rest.
        assert!(glb.root.nodes.iter().all(|n| n.rotation.is_none() && n.mesh.is_none()));
        let moving = (0..glb.root.nodes.len()).filter(|&n| glb.track(n, "translation").is_some());
        assert_eq!(moving.collect::<Vec<_>>(), [glb.node("hips").unwrap()]);
    }

    #[test]
    fn other_joints_stay_but_are_not_mapped() {
        let mut recording = walk(2);
        recording.rig.joints.push(visavis::Joint { name: "tail".into(), parent: Some(0), offset: [0.0, 0.0, -0.1] });
        for frame in &mut recording.frames {
            frame.local.push(glam::Quat::IDENTITY);
        }
        let glb = Glb::parse(&vrma(&recording).unwrap());
        let bones = &glb.json["extensions"][EXTENSION]["humanoid"]["humanBones"];
        assert!(glb.node("tail").is_some() && bones.get("tail").is_none());
    }

    #[test]
    fn refuses_what_is_not_a_humanoid() {
        let mut recording = walk(2);
        recording.rig.joints[8].name = "elbow".into();
        let e = write_vrma(&recording, "never-written.vrma").unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Argument);
        assert!(e.to_string().contains("leftLowerArm"), "{e}");
        assert!(!Path::new("never-written.vrma").exists());
    }
}
