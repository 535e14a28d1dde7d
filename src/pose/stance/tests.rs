//! Planted feet stay, swinging feet are free, legs keep their bones.

use super::ik::reach;
use super::*;
use crate::frame::Root;
use glam::Quat;

const LEGS: [[&str; 4]; 2] = [
    ["leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes"],
    ["rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes"],
];

/// The rig at rest with slightly bent knees, feet (sole under the ankle) given in the heading
/// frame: `[left, right]`.
fn standing(rig: &Rig, feet: [Vec3; 2]) -> Vec<Transform> {
    let mut joints = vec![Transform::IDENTITY; rig.len()];
    rig.fk(rig.offset(0) - 0.02 * Vec3::Y, &vec![Quat::IDENTITY; rig.len()], &mut joints);
    for (foot, names) in feet.iter().zip(LEGS) {
        let [upper, lower, ankle, toes] = names.map(|name| rig.index(name).unwrap());
        let height = joints[ankle].position.y + 0.02;
        let chain = [upper, lower, ankle].map(|j| joints[j].position);
        let leg = reach(chain, *foot + height * Vec3::Y, Vec3::Z).unwrap();
        (joints[lower].position, joints[ankle].position) = (leg.knee, leg.ankle);
        joints[toes].position = leg.ankle + rig.offset(toes);
    }
    joints
}

/// The same for feet in the world, seen from `root`.
fn standing_at(rig: &Rig, root: &Root, feet: [Vec3; 2]) -> Vec<Transform> {
    let mut joints = standing(rig, feet.map(|foot| root.to_local(foot)));
    // Toes point along +Z of the world.
    for [.., ankle, toes] in LEGS.map(|names| names.map(|name| rig.index(name).unwrap())) {
        let ahead = root.to_world(joints[ankle].position) + rig.offset(toes);
        joints[toes].position = root.to_local(ahead);
    }
    joints
}

/// Walks `decoded` roots (world) while the feet stay at `feet`; returns the corrected root's way.
fn follow(decoded: &[Root], feet: impl Fn(usize) -> [Vec3; 2]) -> Vec<Root> {
    let rig = Rig::humanoid();
    let mut stance = Stance::new(&rig);
    let mut root = decoded[0];
    stance.hold(&mut standing_at(&rig, &decoded[0], feet(0)), [0.0; 3]);
    let mut way = vec![root];
    for (i, pair) in decoded.windows(2).enumerate() {
        let local = pair[0].to_local(Vec3::new(pair[1].x as f32, 0.0, pair[1].z as f32));
        let slip = [0.002, 0.0, 0.004];
        let step = [local.x + slip[0], local.z, (pair[1].yaw - pair[0].yaw) as f32 + slip[2]];
        let [vx, vz, dyaw] = stance.hold(&mut standing_at(&rig, &pair[1], feet(i + 1)), step);
        root = root.advanced(vx, vz, dyaw);
        way.push(root);
    }
    way
}

fn sway(frames: usize) -> Vec<Root> {
    let at = |i: usize| (i as f64 * 0.2).sin();
    (0..frames).map(|i| Root { x: 0.03 * at(i), z: -0.02 * at(i), yaw: 0.5 + 0.1 * at(i) }).collect()
}

#[test]
fn planted_feet_stay_though_the_decoded_root_slips() {
    let feet = [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.0, 0.05)];
    let true_way = sway(300);
    // Each decoded step is 2 mm and 0.23 degrees off: 60 cm and 69 degrees over these ten seconds.
    for (a, b) in follow(&true_way, |_| feet).iter().zip(&true_way) {
        assert!((a.x - b.x).hypot(a.z - b.z) < 2e-4, "{a:?} {b:?}");
        assert!((a.yaw - b.yaw).abs() < 1e-4, "{a:?} {b:?}");
    }
}

#[test]
fn one_planted_foot_holds_the_place() {
    let lifted = [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.3, 0.0)];
    let way = follow(&sway(100), |_| lifted);
    // The heading is not known from one foot and drifts; the standing foot stays: its distance from
    // the root does.
    for (a, b) in way.iter().zip(&sway(100)) {
        let from = |r: &Root| (r.x - 0.1).hypot(r.z);
        assert!((from(a) - from(b)).abs() < 2e-3, "{a:?} {b:?}");
    }
}

#[test]
fn feet_in_the_air_or_swinging_say_nothing() {
    let true_way = sway(50);
    let drift = |way: Vec<Root>| way.last().unwrap().yaw - true_way.last().unwrap().yaw;
    let jump = follow(&true_way, |_| [Vec3::new(0.1, 0.2, 0.0), Vec3::new(-0.1, 0.2, 0.0)]);
    assert!((drift(jump) - 49.0 * 0.004).abs() < 1e-4, "decoded steps as they are");
    let swing = follow(&true_way, |i| {
        let z = if i % 2 == 0 { 0.0 } else { 0.1 };
        [Vec3::new(0.1, 0.0, z), Vec3::new(-0.1, 0.0, z)]
    });
    assert!((drift(swing) - 49.0 * 0.004).abs() < 1e-4, "3 m/s is no stance");
}

/// Frames of feet as decoded (heading frame, root still): what is shown of the ankles, in the
/// world.
fn shown(frames: usize, feet: impl Fn(usize) -> [Vec3; 2]) -> Vec<[Vec3; 2]> {
    let rig = Rig::humanoid();
    let mut stance = Stance::new(&rig);
    let mut root = Root::default();
    let frame = |i| {
        let decoded = standing(&rig, feet(i));
        let mut joints = decoded.clone();
        let [vx, vz, dyaw] = stance.hold(&mut joints, [0.0; 3]);
        root = root.advanced(vx, vz, dyaw);
        for names in LEGS {
            let length =
                |j: usize, all: &[Transform]| all[j].position.distance(all[rig.joints[j].parent.unwrap()].position);
            for j in names.map(|name| rig.index(name).unwrap()) {
                assert!((length(j, &joints) - length(j, &decoded)).abs() < 1e-5, "{} in frame {i}", rig.joints[j].name);
            }
            let [upper, lower, ankle, _] = names.map(|name| joints[rig.index(name).unwrap()].position);
            assert!(lower.z > 0.5 * (upper.z + ankle.z) - 1e-3, "the knee bends forward, frame {i}");
        }
        [0, 1].map(|s| root.to_world(joints[rig.index(LEGS[s][2]).unwrap()].position))
    };
    (0..frames).map(frame).collect()
}

#[test]
fn feet_that_drift_apart_are_held_by_the_legs() {
    // 1 mm per frame each, to either side: no root can make up for that.
    let drift = |i: usize| 0.001 * i as f32;
    let way = shown(40, |i| [Vec3::new(0.1 + drift(i), 0.0, 0.0), Vec3::new(-0.1 - drift(i), 0.0, 0.0)]);
    for pair in way.windows(2) {
        for s in [0, 1] {
            assert!(pair[0][s].distance(pair[1][s]) < 5e-5, "{:?} {:?}", pair[0], pair[1]);
        }
    }
}

#[test]
fn what_drifts_too_far_slides() {
    let drift = |i: usize| 0.002 * i as f32;
    let way = shown(80, |i| [Vec3::new(0.1 + drift(i), 0.0, 0.0), Vec3::new(-0.1 - drift(i), 0.0, 0.0)]);
    let apart = |feet: &[Vec3; 2]| (feet[0] - feet[1]).x;
    assert!(apart(&way[35]) < 0.205, "{:?}", way[35]);
    assert!((apart(&way[79]) - (0.2 + 2.0 * (drift(79) - 0.08))).abs() < 0.01, "{:?}", way[79]);
}

#[test]
fn a_foot_that_swings_comes_back_to_where_it_is_decoded() {
    let lift = |i: usize| if i < 30 { 0.0 } else { 0.1 };
    let feet = |i: usize| {
        let drift = 0.0015 * i.min(30) as f32;
        [Vec3::new(0.1 + drift, lift(i), 0.0), Vec3::new(-0.1 - drift, 0.0, 0.0)]
    };
    let way = shown(60, feet);
    let held = way[29][0].x - way[29][1].x;
    assert!((held - 0.2).abs() < 2e-3, "held while planted: {held}");
    // The other foot still stands where it stood, 45 mm from where it is decoded.
    let free = way[59][0].x - way[59][1].x;
    assert!((free - (0.29 - 0.045)).abs() < 3e-3, "free in the air: {free}");
}

#[test]
fn feet_do_not_go_through_the_floor() {
    let rest = shown(1, |_| [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.0, 0.0)])[0][0].y;
    let way = shown(20, |_| [Vec3::new(0.1, -0.02, 0.0), Vec3::new(-0.1, 0.0, 0.0)]);
    assert!((way[19][0].y - rest).abs() < 1e-4, "{:?}", way[19]);
}

#[test]
fn a_foot_that_hovers_is_put_down() {
    let rest = shown(1, |_| [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.0, 0.0)])[0][0].y;
    let way = shown(20, |_| [Vec3::new(0.1, 0.012, 0.0), Vec3::new(-0.1, 0.0, 0.0)]);
    assert!(way.iter().flatten().all(|ankle| (ankle.y - rest).abs() < 1e-4), "{:?}", way[19]);
}

#[test]
fn a_foot_that_lifts_or_lands_does_not_jump() {
    // Up by 12 cm and down again, 8 mm a frame at most.
    let height = |i: usize| 0.06 * (1.0 - (i as f32 * std::f32::consts::TAU / 48.0).cos());
    let way = shown(97, |i| [Vec3::new(0.1, height(i), 0.0), Vec3::new(-0.1, 0.0, 0.0)]);
    let steps = way.windows(2).map(|pair| (pair[1][0].y - pair[0][0].y).abs());
    let most = steps.fold(0.0, f32::max);
    assert!(most < 0.02, "{most}");
    assert!((way[24][0].y - way[24][1].y - 0.12).abs() < 1e-3, "free in the air: {:?}", way[24]);
}

#[test]
fn a_tipped_foot_is_put_flat_and_one_on_its_toes_is_not() {
    let rig = Rig::humanoid();
    let [.., ankle, toes] = LEGS[0].map(|name| rig.index(name).unwrap());
    let feet = [Vec3::new(0.1, 0.0, 0.0), Vec3::new(-0.1, 0.0, 0.0)];
    let heights = |joints: &[Transform]| [ankle, toes].map(|j| joints[j].position.y);
    let rest = heights(&standing(&rig, feet));
    for (tip, put) in [(0.004, true), (-0.004, true), (-0.03, false), (0.03, false)] {
        let mut stance = Stance::new(&rig);
        let mut off = [0.0; 2];
        for _ in 0..3 {
            let mut joints = standing(&rig, feet);
            // About the heel where the toes are up, about the toes where the heel is.
            if tip > 0.0 {
                joints[toes].position.y += tip;
            } else {
                joints[ankle].position.y -= tip;
            }
            stance.hold(&mut joints, [0.0; 3]);
            let shown = heights(&joints);
            off = [0, 1].map(|i| shown[i] - rest[i]);
        }
        assert_eq!(off[0].abs().max(off[1].abs()) < 1e-4, put, "{tip}: {off:?}");
    }
}

#[test]
fn legs_reach_as_far_as_they_are_long() {
    let leg = [Vec3::new(0.0, 0.9, 0.0), Vec3::new(0.0, 0.49, 0.08), Vec3::new(0.0, 0.08, 0.0)];
    let same = reach(leg, leg[2], Vec3::Z).unwrap();
    assert!(same.knee.distance(leg[1]) < 1e-6 && same.ankle.distance(leg[2]) < 1e-6);
    let far = reach(leg, Vec3::new(0.0, 0.0, 1.0), Vec3::Z).unwrap();
    assert!(far.ankle.distance(leg[0]) < 0.84 && far.ankle.z > 0.5, "{far:?}");
    let straight = [leg[0], Vec3::new(0.0, 0.49, 0.0), leg[2]];
    let bent = reach(straight, Vec3::new(0.0, 0.2, 0.0), Vec3::Z).unwrap();
    assert!(bent.knee.z > 0.1, "{bent:?}");
    let turned = bent.turns[0] * (straight[1] - straight[0]);
    assert!(turned.distance(bent.knee - leg[0]) < 1e-5, "bones point where the joints are");
    assert!(reach([leg[0], leg[0], leg[2]], leg[2], Vec3::Z).is_none(), "a bone without length");
}
