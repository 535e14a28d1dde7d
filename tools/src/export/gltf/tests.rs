//! Reads the bytes back with nothing but the format's definition and plays the animation.

use super::*;
use crate::synthetic::walk;
use glam::{Mat4, Quat};
use gltf_json::Root;
use visavis::Transform;

/// A parsed .glb.
pub(in crate::export) struct Glb {
    pub(in crate::export) root: Root,
    pub(in crate::export) json: serde_json::Value,
    bin: Vec<u8>,
}

impl Glb {
    pub(in crate::export) fn parse(bytes: &[u8]) -> Self {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let json_size = word(12);
        assert_eq!((&bytes[16..20], json_size % 4), (&b"JSON"[..], 0));
        let json = &bytes[20..20 + json_size];
        let bin = 20 + json_size;
        assert_eq!((&bytes[bin + 4..bin + 8], word(bin) % 4), (&b"BIN\0"[..], 0));
        let bin_bytes = bytes[bin + 8..].to_vec();
        assert_eq!(bin_bytes.len(), word(bin));
        let root: Root = gltf_json::deserialize::from_slice(json).unwrap();
        let mut problems = Vec::new();
        use gltf_json::validation::Validate;
        root.validate(&root, gltf_json::Path::new, &mut |path, e| problems.push(format!("{} {e}", path())));
        assert!(problems.is_empty(), "{problems:?}");
        Self { root, json: serde_json::from_slice(json).unwrap(), bin: bin_bytes }
    }

    pub(in crate::export) fn floats(&self, accessor: usize) -> Vec<f32> {
        let view = self.root.accessors[accessor].buffer_view.unwrap();
        let view = &self.root.buffer_views[view.value()];
        let (at, length) = (view.byte_offset.unwrap().0 as usize, view.byte_length.0 as usize);
        assert_eq!(at % 4, 0);
        let bytes = &self.bin[at..at + length];
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// Output of the channel of this node and path (as in the JSON).
    pub(in crate::export) fn track(&self, node: usize, path: &str) -> Option<Vec<f32>> {
        let animation = &self.json["animations"][0];
        let is = |c: &&serde_json::Value| c["target"]["node"] == node && c["target"]["path"] == path;
        let channel = animation["channels"].as_array().unwrap().iter().find(is)?;
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        Some(self.floats(sampler["output"].as_u64().unwrap() as usize))
    }

    pub(in crate::export) fn node(&self, name: &str) -> Option<usize> {
        self.root.nodes.iter().position(|n| n.name.as_deref() == Some(name))
    }

    /// World transforms of the nodes at this frame.
    fn play(&self, frame: usize) -> Vec<Mat4> {
        let mut out = vec![Mat4::IDENTITY; self.root.nodes.len()];
        let mut open: Vec<(usize, Mat4)> =
            self.root.scenes[0].nodes.iter().map(|n| (n.value(), Mat4::IDENTITY)).collect();
        while let Some((i, parent)) = open.pop() {
            let node = &self.root.nodes[i];
            let rest = Vec3::from(node.translation.unwrap_or_default());
            let translation = self.track(i, "translation").map_or(rest, |t| Vec3::from_slice(&t[3 * frame..]));
            let turn = self.track(i, "rotation").map_or(Quat::IDENTITY, |t| Quat::from_slice(&t[4 * frame..]));
            out[i] = parent * Mat4::from_rotation_translation(turn, translation);
            open.extend(node.children.iter().flatten().map(|c| (c.value(), out[i])));
        }
        out
    }
}

/// Every joint of the file stands where the rig does.
pub(in crate::export) fn assert_plays(glb: &Glb, recording: &Recording) {
    let mut expected = vec![Transform::IDENTITY; recording.rig.len()];
    for i in [0, 1, recording.frames.len() / 2, recording.frames.len() - 1] {
        let frame = &recording.frames[i];
        recording.rig.fk(frame.hips, &frame.local, &mut expected);
        let played = glb.play(i);
        for (joint, e) in recording.rig.joints.iter().zip(&expected) {
            let at = played[glb.node(&joint.name).unwrap()].w_axis.truncate();
            assert!(at.distance(e.position) < 1e-5, "{} in frame {i}: {at} {}", joint.name, e.position);
        }
    }
    let time = glb.json["animations"][0]["samplers"][0]["input"].as_u64().unwrap() as usize;
    let times = glb.floats(time);
    assert_eq!(times.len(), recording.frames.len());
    assert!(times.iter().enumerate().all(|(i, t)| (t - i as f32 / 30.0).abs() < 1e-4));
}

#[test]
fn plays_as_recorded() {
    let recording = walk(90);
    let parsed = Glb::parse(&glb(&recording).unwrap());
    assert_plays(&parsed, &recording);
    let user = parsed.node("userHead").unwrap();
    let places = parsed.track(user, "translation").unwrap();
    let scales = parsed.track(user, "scale").unwrap();
    for (i, user) in recording.user.iter().enumerate() {
        assert_eq!(scales[3 * i], f32::from(u8::from(user.is_some())));
        if let Some(user) = user {
            assert_eq!(Vec3::from_slice(&places[3 * i..]), *user);
        }
    }
}

#[test]
fn the_mesh_at_rest_is_bound_to_the_rest_pose() {
    let recording = walk(2);
    let parsed = Glb::parse(&glb(&recording).unwrap());
    let skin = &parsed.root.skins[0];
    assert_eq!(skin.joints.len(), 22);
    let inverse = parsed.floats(skin.inverse_bind_matrices.unwrap().value());
    let head = recording.rig.index("head").unwrap();
    let bind = Mat4::from_cols_slice(&inverse[16 * head..16 * head + 16]);
    assert!((bind.w_axis.y + 1.50).abs() < 0.05, "head at {}", -bind.w_axis.y);
    let positions = parsed.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap();
    let accessor = &parsed.json["accessors"][positions as usize];
    let values = parsed.floats(positions as usize);
    for axis in 0..3 {
        let column = || values.iter().skip(axis).step_by(3).copied();
        assert_eq!(accessor["min"][axis].as_f64().unwrap() as f32, column().fold(f32::MAX, f32::min));
        assert_eq!(accessor["max"][axis].as_f64().unwrap() as f32, column().fold(f32::MIN, f32::max));
    }
}

#[test]
fn without_a_user_there_is_no_ball() {
    let mut recording = walk(5);
    recording.user.fill(None);
    assert_eq!(Glb::parse(&glb(&recording).unwrap()).node("userHead"), None);
    recording.user.fill(Some(Vec3::Y));
    let parsed = Glb::parse(&glb(&recording).unwrap());
    assert!(parsed.track(parsed.node("userHead").unwrap(), "scale").is_none());
}
