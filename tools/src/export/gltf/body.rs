//! A simple person built around a rig: rounded cones that each follow one joint.

use super::super::tip;
use super::solid::Solid;
use glam::Vec3;
use visavis::Rig;

/// Materials: name and linear colour.
const PARTS: [(&str, [f32; 3]); 5] = [
    ("skin", [0.62, 0.36, 0.25]),
    ("shirt", [0.10, 0.26, 0.42]),
    ("trousers", [0.06, 0.07, 0.10]),
    ("shoes", [0.02, 0.02, 0.02]),
    ("eyes", [0.01, 0.01, 0.01]),
];
const SKIN: usize = 0;
const SHIRT: usize = 1;
const TROUSERS: usize = 2;
const SHOES: usize = 3;
const EYES: usize = 4;
/// Height of the hips of the body that the radii below were chosen for, metres.
const HIPS: f32 = 0.92;

/// The body of a rig in its rest pose.
pub(super) struct Body {
    solids: [Solid; PARTS.len()],
    rest: Vec<Vec3>,
    scale: f32,
}

impl Body {
    /// Builds the body: arms, legs, trunk and head from the humanoid names, a thin bone for joints
    /// of other names.
    pub(super) fn of(rig: &Rig) -> Self {
        let mut rest: Vec<Vec3> = Vec::with_capacity(rig.len());
        for (j, joint) in rig.joints.iter().enumerate() {
            rest.push(joint.parent.map_or(Vec3::ZERO, |p| rest[p]) + rig.offset(j));
        }
        let scale = (rest[0].y / HIPS).clamp(0.3, 3.0);
        let mut body = Self { solids: Default::default(), rest, scale };
        for j in 0..rig.len() {
            body.bone(rig, j);
        }
        body
    }

    /// Name, colour and triangles of each material that is in use.
    pub(super) fn parts(&self) -> impl Iterator<Item = (&'static str, [f32; 3], &Solid)> {
        PARTS.iter().zip(&self.solids).filter(|(_, s)| !s.triangles.is_empty()).map(|((n, c), s)| (*n, *c, s))
    }

    /// Rest position of each joint, metres.
    pub(super) fn rest(&self) -> &[Vec3] {
        &self.rest
    }

    fn bone(&mut self, rig: &Rig, j: usize) {
        let to = rig.children(j).next().map_or_else(|| tip(rig, j), |c| rig.offset(c));
        let name = rig.joints[j].name.as_str();
        match name.trim_start_matches("left").trim_start_matches("right") {
            "hips" => self.slab(TROUSERS, j, Vec3::NEG_Y * 0.02 * self.scale, 0.075, 0.105),
            "spine" => self.slab(SHIRT, j, to * 0.5, 0.055, 0.105),
            "chest" => self.slab(SHIRT, j, to * 0.6, 0.07, 0.11),
            "upperChest" => self.slab(SHIRT, j, to * 0.02, 0.085, 0.105),
            "Shoulder" => self.cone(SHIRT, j, Vec3::NEG_Y * 0.01, to, [0.06, 0.06], Vec3::ONE),
            "neck" => self.cone(SKIN, j, to * -0.3, to, [0.052, 0.05], Vec3::ONE),
            "head" => self.head(rig, j, to),
            "UpperArm" => self.cone(SHIRT, j, Vec3::ZERO, to, [0.058, 0.042], Vec3::ONE),
            "LowerArm" => self.cone(SKIN, j, Vec3::ZERO, to, [0.042, 0.030], Vec3::ONE),
            "Hand" => self.cone(SKIN, j, to * 0.2, to * 0.75, [0.042, 0.030], Vec3::new(1.0, 0.45, 1.0)),
            "UpperLeg" => self.cone(TROUSERS, j, Vec3::ZERO, to, [0.088, 0.058], Vec3::ONE),
            "LowerLeg" => self.cone(TROUSERS, j, Vec3::ZERO, to, [0.058, 0.042], Vec3::ONE),
            "Foot" => {
                let ground = Vec3::Y * (0.035 * self.scale - self.rest[j].y).min(0.0);
                self.cone(SHOES, j, ground + Vec3::NEG_Z * 0.03, to.with_y(ground.y), [0.04, 0.042], Vec3::ONE);
            }
            "Toes" => {
                let ground = Vec3::Y * (0.033 * self.scale - self.rest[j].y);
                self.cone(SHOES, j, ground, ground + to * 0.6, [0.042, 0.034], Vec3::new(1.0, 0.8, 1.0));
            }
            _ => self.cone(SKIN, j, Vec3::ZERO, to, [0.02, 0.02], Vec3::ONE),
        }
    }

    /// A piece of the trunk: wide, not deep, around `at` in the frame of joint `j`.
    fn slab(&mut self, part: usize, j: usize, at: Vec3, half_width: f32, radius: f32) {
        let wide = Vec3::X * half_width * self.scale;
        self.cone(part, j, at - wide, at + wide, [radius; 2], Vec3::new(1.0, 1.45, 0.85));
    }

    /// Skull, nose and eyes, so that one sees where the head faces.
    fn head(&mut self, rig: &Rig, j: usize, crown: Vec3) {
        let eyes = Vec3::from(rig.eyes);
        let middle = crown.with_y(eyes.y);
        let ball = Vec3::new(0.80, 1.08, 1.0);
        self.cone(SKIN, j, middle, middle, [0.105 / self.scale; 2], ball * (crown.y / 0.18));
        let unit = crown.y / 0.18;
        for side in [-1.0, 1.0] {
            let eye = eyes + Vec3::new(0.032 * side, 0.0, 0.0) * unit;
            self.cone(EYES, j, eye, eye, [0.013; 2], Vec3::ONE);
        }
        let nose = eyes + Vec3::new(0.0, -0.03, 0.008) * unit;
        self.cone(SKIN, j, nose + Vec3::Y * 0.02 * unit, nose, [0.010, 0.016], Vec3::ONE);
    }

    /// Radii are those of the reference body and scaled to this one; points are in the frame of
    /// joint `j`.
    fn cone(&mut self, part: usize, j: usize, a: Vec3, b: Vec3, radii: [f32; 2], stretch: Vec3) {
        let Ok(joint) = u8::try_from(j) else { return };
        let at = self.rest[j];
        self.solids[part].cone(joint, at + a, at + b, radii.map(|r| r * self.scale), stretch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_an_adult_on_the_floor() {
        let rig = Rig::humanoid();
        let body = Body::of(&rig);
        let points: Vec<Vec3> = body.parts().flat_map(|(_, _, s)| &s.positions).map(|p| Vec3::from(*p)).collect();
        let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
        assert!(low.y.abs() < 0.02, "soles at {}", low.y);
        assert!((1.62..1.80).contains(&high.y), "crown at {}", high.y);
        assert!((high.x + low.x).abs() < 1e-3, "not symmetric");
        let of = |j: usize| body.parts().flat_map(|(_, _, s)| &s.joints).any(|&k| usize::from(k) == j);
        assert!((0..rig.len()).all(of), "a joint moves nothing");
        assert_eq!(body.parts().count(), 5);
    }

    #[test]
    fn other_joints_get_a_bone() {
        let mut rig = Rig::humanoid();
        let tail = visavis::Joint { name: "tail".into(), parent: Some(0), offset: [0.0, 0.0, -0.1] };
        rig.joints.push(tail);
        let body = Body::of(&rig);
        assert!(body.parts().flat_map(|(_, _, s)| &s.joints).any(|&j| j == 22));
    }
}
