//! Round trip through a parser that knows nothing of the writer.

use super::super::scratch::Scratch;
use super::*;
use crate::synthetic::walk;
use glam::{DMat3, DVec3};
use visavis::Transform;

struct Node {
    name: String,
    parent: Option<usize>,
    offset: DVec3,
    channels: Vec<String>,
}

struct Bvh {
    nodes: Vec<Node>,
    frame_time: f64,
    /// World positions of the nodes, centimetres, a frame.
    positions: Vec<Vec<DVec3>>,
}

fn parse(text: &str) -> Bvh {
    let (head, motion) = text.split_once("MOTION").expect("MOTION");
    let mut words = head.split_whitespace();
    assert_eq!(words.next(), Some("HIERARCHY"));
    let (mut nodes, mut open): (Vec<Node>, Vec<usize>) = (Vec::new(), Vec::new());
    while let Some(word) = words.next() {
        let mut number = || words.next().and_then(|w| w.parse::<f64>().ok()).expect("a number");
        match word {
            "ROOT" | "JOINT" | "End" => {
                let name = words.next().expect("a name").to_owned();
                let parent = open.last().copied();
                nodes.push(Node { name, parent, offset: DVec3::ZERO, channels: Vec::new() });
            }
            "{" => open.push(nodes.len() - 1),
            "}" => drop(open.pop().expect("a matching brace")),
            "OFFSET" => nodes.last_mut().unwrap().offset = DVec3::new(number(), number(), number()),
            "CHANNELS" => {
                let n = number() as usize;
                nodes.last_mut().unwrap().channels = words.by_ref().take(n).map(str::to_owned).collect();
            }
            other => panic!("unexpected `{other}`"),
        }
    }
    assert!(open.is_empty());
    let mut lines = motion.trim().lines();
    let count: usize = lines.next().unwrap().strip_prefix("Frames: ").unwrap().parse().unwrap();
    let frame_time = lines.next().unwrap().strip_prefix("Frame Time: ").unwrap().parse().unwrap();
    let positions: Vec<_> = lines.map(|line| pose(&nodes, line)).collect();
    assert_eq!(positions.len(), count);
    Bvh { nodes, frame_time, positions }
}

fn pose(nodes: &[Node], line: &str) -> Vec<DVec3> {
    let mut values = line.split_whitespace().map(|v| v.parse::<f64>().expect("a number"));
    let mut placed: Vec<(DVec3, DMat3)> = Vec::new();
    for node in nodes {
        let (mut position, mut turn) = (node.offset, DMat3::IDENTITY);
        for channel in &node.channels {
            let v = values.next().expect("a value a channel");
            match channel.as_str() {
                "Xposition" => position.x += v,
                "Yposition" => position.y += v,
                "Zposition" => position.z += v,
                "Xrotation" => turn *= DMat3::from_rotation_x(v.to_radians()),
                "Yrotation" => turn *= DMat3::from_rotation_y(v.to_radians()),
                "Zrotation" => turn *= DMat3::from_rotation_z(v.to_radians()),
                other => panic!("unknown channel {other}"),
            }
        }
        placed.push(match node.parent {
            None => (position, turn),
            Some(p) => (placed[p].0 + placed[p].1 * position, placed[p].1 * turn),
        });
    }
    assert_eq!(values.next(), None, "more values than channels");
    placed.into_iter().map(|(p, _)| p).collect()
}

fn round_trip(recording: &Recording) -> Bvh {
    let dir = Scratch::new("bvh");
    let path = dir.path("motion.bvh");
    write_bvh(recording, &path).unwrap();
    parse(&std::fs::read_to_string(path).unwrap())
}

#[test]
fn positions_are_those_of_the_rig() {
    let mut recording = walk(600);
    // Frames whose decoded joints are not the rig's: BVH holds the rig's.
    for frame in &mut recording.frames {
        frame.global.fill(Transform::IDENTITY);
    }
    let bvh = round_trip(&recording);
    assert!((bvh.frame_time * 30.0 - 1.0).abs() < 1e-7);
    assert_eq!(bvh.positions.len(), 600);
    let mut expected = vec![Transform::IDENTITY; recording.rig.len()];
    let mut worst = 0f64;
    for (frame, got) in recording.frames.iter().zip(&bvh.positions) {
        recording.rig.fk(frame.hips, &frame.local, &mut expected);
        for (joint, e) in recording.rig.joints.iter().zip(&expected) {
            let i = bvh.nodes.iter().position(|n| n.name == joint.name).expect("every joint is there");
            worst = worst.max((got[i] / 100.0).distance(e.position.as_dvec3()));
        }
    }
    println!("BVH round trip: {:.5} mm", worst * 1000.0);
    assert!(worst < 1e-5, "{worst} m");
}

#[test]
fn the_hierarchy_is_the_rig() {
    let recording = walk(1);
    let bvh = round_trip(&recording);
    for joint in &recording.rig.joints {
        let node = bvh.nodes.iter().find(|n| n.name == joint.name).unwrap();
        let parent = node.parent.map(|p| bvh.nodes[p].name.as_str());
        assert_eq!(parent, joint.parent.map(|p| recording.rig.joints[p].name.as_str()));
    }
    let ends: Vec<_> = bvh.nodes.iter().filter(|n| n.name == "Site").collect();
    assert_eq!(ends.len(), 5, "head, hands, toes");
    assert!(ends.iter().all(|n| n.offset.length() > 3.0 && n.offset.length() < 30.0 && n.channels.is_empty()));
}
