//! The leg of a planted foot: what the root cannot take up.

use super::super::fit::swing;
use super::ik::{lowest, reach};
use super::{Contact, HEIGHT, earlier, fade, floor, turn, turned};
use crate::frame::Transform;
use crate::pose::Rig;
use glam::{Quat, Vec2, Vec3};

/// Share of its displacement that a swinging foot loses in a frame.
const RELEASE: f32 = 0.25;
/// A foot comes down by at most this much in a frame, metres.
const LOWER: f32 = 0.0015;
/// A planted foot is held up to this far from where it was decoded, metres; beyond that it slides.
const FURTHEST: f32 = 0.08;
/// And turned by up to this angle, radians.
const MOST_TURNED: f32 = 0.4;

/// Holds one foot.
#[derive(Debug, Clone)]
pub(super) struct Leg {
    /// Hips, upper leg, lower leg, foot, toes.
    chain: [usize; 5],
    /// How far the foot is from where it was decoded, `(x, z)` in the heading frame of the frame
    /// before, metres; about Y, radians.
    moved: Vec2,
    twisted: f32,
    /// How much lower than decoded heel and toes are, metres.
    lowered: [f32; 2],
    /// Heel and toes as shown, in the heading frame of the frame before.
    shown: [Vec3; 2],
}

impl Leg {
    /// The leg of `side` ("left", "right"), if the rig has a whole one.
    pub(super) fn new(rig: &Rig, side: &str) -> Option<Self> {
        let joint = |name: &str| rig.index(&format!("{side}{name}"));
        let chain = [rig.index("hips")?, joint("UpperLeg")?, joint("LowerLeg")?, joint("Foot")?, joint("Toes")?];
        let whole = chain.windows(2).all(|pair| rig.joints[pair[1]].parent == Some(pair[0]));
        let leg = Self { chain, moved: Vec2::ZERO, twisted: 0.0, lowered: [0.0; 2], shown: [Vec3::ZERO; 2] };
        whole.then_some(leg)
    }

    /// Forgets where the foot was.
    pub(super) fn reset(&mut self) {
        (self.moved, self.twisted) = (Vec2::ZERO, 0.0);
    }

    /// The first frame: a foot near the floor stands on it. `now` are heel and toes as decoded.
    pub(super) fn start(&mut self, joints: &mut [Transform], contact: &Contact, now: &[Vec3; 2]) {
        self.lowered = contact.down(Vec2::ZERO);
        let sole = tipped(now[1] - now[0], self.lowered[0] - self.lowered[1]);
        self.shown = self.place(joints, now[0] - self.lowered[0] * Vec3::Y, sole);
    }

    /// Moves the leg in `joints` so that a planted foot is shown on the floor, where it was shown in
    /// the frame before. `before` and `now` are heel and toes as decoded, each in the heading frame of its
    /// frame; `step`, corrected, lies between.
    pub(super) fn hold(
        &mut self,
        joints: &mut [Transform],
        contact: &Contact,
        before: &[Vec3; 2],
        now: &[Vec3; 2],
        step: [f32; 3],
    ) {
        let low = contact.low;
        let slide = earlier(now[low], step) - floor(before[low]);
        let planted = contact.planted(slide);
        // A foot on its toes turns about them: its direction is held as far as both are down.
        let flat = planted * fade(contact.clearance[1 - low], HEIGHT);
        let down = contact.down(slide);
        self.lowered = [0, 1].map(|i| down[i].min(self.lowered[i].max(0.0) + LOWER));
        let sole = tipped(now[1] - now[0], self.lowered[0] - self.lowered[1]);
        // Everything below is in this frame's heading frame.
        let later = |p: Vec3| turned(floor(p) - Vec2::new(step[0], step[1]), -step[2]);
        let shown = self.shown.map(later);
        self.moved = turned(self.moved, -step[2]);

        let line = floor(sole);
        self.twisted -= flat * turn(shown[1] - shown[0], turned(line, self.twisted));
        let place = |moved: Vec2, twisted: f32| {
            let heel = floor(now[0]) + moved;
            [heel, heel + turned(line, twisted)]
        };
        self.moved -= planted * (place(self.moved, self.twisted)[low] - shown[low]);
        let keep = 1.0 - RELEASE * (1.0 - planted);
        self.moved = (keep * self.moved).clamp_length_max(FURTHEST);
        self.twisted = ((1.0 - RELEASE * (1.0 - flat)) * self.twisted).clamp(-MOST_TURNED, MOST_TURNED);

        let target = now[0] + Vec3::new(self.moved.x, -self.lowered[0], self.moved.y);
        self.shown = self.place(joints, target, sole);
    }

    /// Puts the ankle at `target` as far as the leg reaches, turns the foot so that `sole`, turned
    /// by the twist, goes from heel to toes, and tells where these are then.
    fn place(&self, joints: &mut [Transform], target: Vec3, sole: Vec3) -> [Vec3; 2] {
        let [hips, upper, lower, foot, toes] = self.chain;
        let at = |j: usize| joints[j].position;
        let forward = joints[hips].rotation * Vec3::Z;
        let chain = [at(upper), at(lower), at(foot)];
        // A leg that is too short for the floor leaves its foot where it is, not nearer to the body.
        let target = Vec3 { y: target.y.max(lowest(chain, target)), ..target };
        let Some(leg) = reach(chain, target, forward) else {
            return [at(foot), at(toes)];
        };
        let twist = Quat::from_rotation_y(self.twisted);
        let turned = twist * swing(at(toes) - at(foot), sole);
        let tip = leg.ankle + twist * sole;
        for (j, turn) in [(upper, leg.turns[0]), (lower, leg.turns[1]), (foot, turned), (toes, turned)] {
            joints[j].rotation = (turn * joints[j].rotation).normalize();
        }
        (joints[lower].position, joints[foot].position, joints[toes].position) = (leg.knee, leg.ankle, tip);
        [leg.ankle, tip]
    }
}

/// The way from heel to toes `sole` with the toes `up` higher, as far as its length allows; one that
/// has no direction on the floor is left as it is.
fn tipped(sole: Vec3, up: f32) -> Vec3 {
    let (length, along) = (sole.length(), floor(sole).length());
    if up == 0.0 || along < 0.1 * length {
        return sole;
    }
    let y = (sole.y + up).clamp(-length, length);
    let share = (length * length - y * y).max(0.0).sqrt() / along;
    Vec3::new(share * sole.x, y, share * sole.z)
}
