//! glTF 2.0 binary: a body on the skeleton, animated, that any glTF viewer shows as a person.

mod animation;
mod body;
pub(super) mod builder;
mod solid;

use super::{atomic::write_atomically, check};
use crate::recording::Recording;
pub(super) use animation::animate;
use body::Body;
use builder::{Builder, node};
use glam::Vec3;
use gltf_json::{Index, Skin, validation::Checked};
use solid::Solid;
use std::path::Path;
use visavis::Result;

/// Radius of the ball that stands for the user's head, metres.
const USER_HEAD: f32 = 0.11;

/// Writes the motion of the rig as a `.glb`: a node a joint (named as in the rig, metres, Y up,
/// facing +Z at rest), a body of rounded cones skinned rigidly to them, one animation at 30 fps
/// from time 0 (translation of the hips, rotation of every joint), and a node `userHead` with a
/// ball where the user's head was. While the user's position is unknown, the ball is scaled to
/// nothing; a recording without any position has no such node.
///
/// # Errors
/// As [`super::write_bvh`].
pub fn write_gltf(recording: &Recording, path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    check(recording, path)?;
    let glb = glb(recording).map_err(|e| e.with_path(path))?;
    write_atomically(path, |w| w.write_all(&glb))
}

fn glb(recording: &Recording) -> Result<Vec<u8>> {
    let mut builder = Builder::new("visavis motion");
    let joints = builder.skeleton(&recording.rig);
    let body = add_body(&mut builder, recording, &joints);
    let user = recording.user.iter().any(Option::is_some).then(|| add_user(&mut builder));
    animate(&mut builder, recording, &joints, user);
    builder.scene([Some(joints[0]), Some(body), user].into_iter().flatten().collect());
    builder.finish()
}

/// The skinned mesh: a primitive a material, all on the same skin.
fn add_body(builder: &mut Builder, recording: &Recording, joints: &[Index<gltf_json::Node>]) -> Index<gltf_json::Node> {
    let body = Body::of(&recording.rig);
    let primitives = body
        .parts()
        .map(|(name, colour, solid)| {
            let material = builder.material(name, colour);
            builder.primitive(solid, material, true)
        })
        .collect();
    let mesh = builder.mesh("body", primitives);
    // At rest all joints are unrotated, so that binding is a translation.
    let inverse: Vec<[f32; 16]> =
        body.rest().iter().map(|p| glam::Mat4::from_translation(-*p).to_cols_array()).collect();
    let inverse = builder.floats(&inverse, gltf_json::accessor::Type::Mat4, None, false);
    let skin = builder.root.push(Skin {
        extensions: None,
        extras: Default::default(),
        inverse_bind_matrices: Some(inverse),
        joints: joints.to_vec(),
        name: Some("body".into()),
        skeleton: Some(joints[0]),
    });
    builder.root.push(gltf_json::Node { mesh: Some(mesh), skin: Some(skin), ..node("body") })
}

fn add_user(builder: &mut Builder) -> Index<gltf_json::Node> {
    let mut ball = Solid::default();
    ball.cone(0, Vec3::ZERO, Vec3::ZERO, [USER_HEAD; 2], Vec3::ONE);
    let material = builder.material("user", [0.95, 0.55, 0.15]);
    let primitive = builder.primitive(&ball, material, false);
    let mesh = builder.mesh("userHead", vec![primitive]);
    builder.root.push(gltf_json::Node { mesh: Some(mesh), ..node("userHead") })
}

/// Shorthand of the crate's validity marker.
fn valid<T>(value: T) -> Checked<T> {
    Checked::Valid(value)
}

#[cfg(test)]
pub(super) mod tests;
