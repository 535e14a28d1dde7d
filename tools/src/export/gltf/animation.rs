//! The animation of a recording.

use super::builder::Builder;
use super::valid;
use crate::recording::Recording;
use glam::Vec3;
use gltf_json::accessor::Type;
use gltf_json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf_json::{Accessor, Animation, Index, Node};
use visavis::FPS;

/// Adds the animation `motion`: translation of the hips, rotation of every joint, and of `user`
/// translation and, where positions are missing, scale (0 while unknown).
pub(in crate::export) fn animate(
    builder: &mut Builder,
    recording: &Recording,
    joints: &[Index<Node>],
    user: Option<Index<Node>>,
) {
    let frames = &recording.frames;
    let times: Vec<[f32; 1]> = (0..frames.len()).map(|i| [(i as f64 / f64::from(FPS)) as f32]).collect();
    let time = builder.floats(&times, Type::Scalar, None, true);
    let mut tracks = Tracks { time, samplers: Vec::new(), channels: Vec::new() };

    let hips: Vec<[f32; 3]> = frames.iter().map(|f| f.hips.to_array()).collect();
    let hips = builder.floats(&hips, Type::Vec3, None, false);
    tracks.add(joints[0], Property::Translation, hips, Interpolation::Linear);
    for (j, &joint) in joints.iter().enumerate() {
        let turns: Vec<[f32; 4]> = frames.iter().map(|f| f.local[j].normalize().to_array()).collect();
        let turns = builder.floats(&turns, Type::Vec4, None, false);
        tracks.add(joint, Property::Rotation, turns, Interpolation::Linear);
    }
    if let Some(user) = user {
        let places: Vec<[f32; 3]> = held(&recording.user).iter().map(Vec3::to_array).collect();
        let places = builder.floats(&places, Type::Vec3, None, false);
        tracks.add(user, Property::Translation, places, Interpolation::Linear);
        if recording.user.contains(&None) {
            let scale = |p: &Option<Vec3>| [if p.is_some() { 1.0 } else { 0.0 }; 3];
            let scales: Vec<[f32; 3]> = recording.user.iter().map(scale).collect();
            let scales = builder.floats(&scales, Type::Vec3, None, false);
            tracks.add(user, Property::Scale, scales, Interpolation::Step);
        }
    }
    let Tracks { samplers, channels, .. } = tracks;
    let name = Some("motion".to_owned());
    builder.root.push(Animation { extensions: None, extras: Default::default(), channels, name, samplers });
}

/// Samplers and channels that share one time track.
struct Tracks {
    time: Index<Accessor>,
    samplers: Vec<Sampler>,
    channels: Vec<Channel>,
}

impl Tracks {
    fn add(&mut self, node: Index<Node>, path: Property, output: Index<Accessor>, interpolation: Interpolation) {
        let (input, interpolation) = (self.time, valid(interpolation));
        let sampler = Sampler { extensions: None, extras: Default::default(), input, interpolation, output };
        let sampler = Index::push(&mut self.samplers, sampler);
        let target = Target { extensions: None, extras: Default::default(), node, path: valid(path) };
        self.channels.push(Channel { sampler, target, extensions: None, extras: Default::default() });
    }
}

/// Positions with gaps filled by the last known one (at the start: the first known one).
fn held(positions: &[Option<Vec3>]) -> Vec<Vec3> {
    let mut last = positions.iter().flatten().next().copied().unwrap_or(Vec3::ZERO);
    let mut hold = |p: &Option<Vec3>| {
        last = p.unwrap_or(last);
        last
    };
    positions.iter().map(&mut hold).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_held() {
        let (a, b) = (Vec3::X, Vec3::Y);
        assert_eq!(held(&[None, Some(a), None, Some(b), None]), [a, a, a, b, b]);
    }
}
