//! Local rotations on the rig's fixed bone lengths from decoded joint transforms.
//!
//! Decoded positions do not keep bone lengths exactly. Going from the hips outwards, each joint is
//! turned so that what it carries comes as near as possible to the decoded positions, seen from
//! where the *fitted* joint is, so that the error of one bone does not move the next:
//!
//! - a joint without children keeps its decoded rotation;
//! - with one child, it is the decoded rotation swung by the shortest arc that points the bone at
//!   the child: twist from the rotation, direction from the position;
//! - with several children, it is the least-squares rotation over the children and the decoded
//!   rotation ([`ROTATION_WEIGHT`]);
//! - the upper bone of a limb is swung at a point that trades the elbow's (knee's) error against
//!   the hand's (foot's), see [`limb_target`]: the end of a limb is what one sees, and what stands
//!   on the floor.

use super::Rig;
use crate::frame::{Frame, Root, Transform};
use crate::kernels::Kernels;
use glam::{Mat3, Quat, Vec3};

/// Weight of a decoded rotation against a child's position (1) in the least squares of a joint with
/// several children, m^2: that of the 12 vertices of an icosahedron of radius 0.1 m: `sum_v |r v|^2
/// / (3 * 12)`.
const ROTATION_WEIGHT: f32 = 4.0 * 0.1 * 0.1 / 12.0;
/// Weight of the squared error of a limb's end against that of its middle joint. At this weight a
/// limb that was decoded too short is only bent out of the straight line when the shortfall exceeds
/// about `l / (2 w)`, 2 cm for a leg. With 2 % of noise, hands and feet are off by 2.2 mm on
/// average at 10, by 6.6 mm at 0 and 1.6 mm at 20, where elbows lose more.
const END_WEIGHT: f32 = 10.0;
/// Gauss-Newton steps of [`limb_target`]; it moves by less than 1e-6 rad after 5.
const LIMB_STEPS: usize = 6;

#[derive(Debug, Clone, Copy)]
enum Plan {
    Leaf,
    Single { child: usize },
    Several,
    Limb { middle: usize, end: usize },
}

/// Fits the rig to decoded transforms; streaming, because quaternion signs follow the frame before.
/// Allocates nothing.
#[derive(Debug, Clone)]
pub struct Fit {
    kernels: Kernels,
    plans: Vec<Plan>,
    parents: Vec<Option<usize>>,
    offsets: Vec<Vec3>,
    /// Local rotations of the frame before.
    previous: Vec<Quat>,
}

impl Fit {
    /// A fit on `rig`, which has passed [`Rig::check`].
    pub fn new(kernels: Kernels, rig: &Rig) -> Self {
        let n = rig.len();
        Self {
            kernels,
            plans: (0..n).map(|j| plan(rig, j)).collect(),
            parents: rig.joints.iter().map(|j| j.parent).collect(),
            offsets: (0..n).map(|j| rig.offset(j)).collect(),
            previous: vec![Quat::IDENTITY; n],
        }
    }

    /// Forgets the frame before.
    pub fn reset(&mut self) {
        self.previous.fill(Quat::IDENTITY);
    }

    /// Fits the rig to `joints` (J transforms in the heading frame of `root`; with
    /// `Root::default()` in the world) and fills `hips`, `local` and `fit_error` of `frame`, but
    /// for the signs of rotations, which depend on the frame before ([`Fit::sign`]). The hips are
    /// where they were decoded. `placed` is scratch for J transforms.
    pub(super) fn turn(&self, placed: &mut [Transform], joints: &[Transform], root: &Root, frame: &mut Frame) {
        assert_eq!(joints.len(), self.plans.len(), "one transform a joint");
        frame.local.resize(joints.len(), Quat::IDENTITY);
        frame.hips = root.to_world(joints[0].position);
        frame.fit_error = 0.0;
        for j in 0..joints.len() {
            let (position, parent) = match self.parents[j] {
                None => (joints[0].position, root.rotation().inverse()),
                Some(p) => {
                    let Transform { position, rotation } = placed[p];
                    (position + rotation * self.offsets[j], rotation)
                }
            };
            let rotation = self.rotation(j, position, joints);
            placed[j] = Transform { position, rotation };
            frame.fit_error = frame.fit_error.max(position.distance(joints[j].position));
            frame.local[j] = (parent.inverse() * rotation).normalize();
        }
    }

    /// Fits the rig to the joints of `frame` in the world, and fills its `hips`, `local` and
    /// `fit_error`. Allocates, unlike what sessions do.
    ///
    /// # Panics
    /// If it has not J joints.
    #[cfg(feature = "internals")]
    pub fn fit(&mut self, frame: &mut Frame) {
        let joints = std::mem::take(&mut frame.global);
        self.turn(&mut vec![Transform::IDENTITY; joints.len()], &joints, &Root::default(), frame);
        self.sign(frame);
        frame.global = joints;
    }

    /// Gives the rotations of `frame` the signs of the frame before.
    pub(super) fn sign(&mut self, frame: &mut Frame) {
        follow(&mut self.previous, frame.local.iter_mut());
    }

    /// Rotation of joint `j`, fitted at `at`, in the frame of `joints`.
    fn rotation(&self, j: usize, at: Vec3, joints: &[Transform]) -> Quat {
        let decoded = joints[j].rotation;
        match self.plans[j] {
            Plan::Leaf => decoded,
            Plan::Single { child } => swing(decoded * self.offsets[child], joints[child].position - at) * decoded,
            Plan::Limb { middle, end } => {
                let lengths = (self.offsets[middle].length(), self.offsets[end].length());
                let target = limb_target(joints[middle].position - at, joints[end].position - at, lengths);
                swing(decoded * self.offsets[middle], target) * decoded
            }
            Plan::Several => {
                let mut a = Mat3::from_quat(decoded) * ROTATION_WEIGHT;
                for (child, &offset) in self.offsets.iter().enumerate() {
                    if self.parents[child] == Some(j) {
                        let d = joints[child].position - at;
                        a += Mat3::from_cols(d * offset.x, d * offset.y, d * offset.z);
                    }
                }
                let mut r = [[0.0; 9]];
                self.kernels.polar(&[a.transpose().to_cols_array()], &mut r);
                Quat::from_mat3(&Mat3::from_cols_array(&r[0]).transpose())
            }
        }
        .normalize()
    }
}

fn plan(rig: &Rig, j: usize) -> Plan {
    let only = |j: usize| {
        let mut children = rig.children(j);
        children.next().filter(|_| children.next().is_none())
    };
    let name = &rig.joints[j].name;
    let limb = name.ends_with("UpperArm") || name.ends_with("UpperLeg");
    match (rig.children(j).next(), only(j)) {
        (None, _) => Plan::Leaf,
        (Some(_), None) => Plan::Several,
        (_, Some(child)) => match only(child) {
            Some(end) if limb => Plan::Limb { middle: child, end },
            _ => Plan::Single { child },
        },
    }
}

/// Gives each of `rotations` the sign that is nearer to its rotation in `previous`, which it
/// replaces.
pub(super) fn follow<'a>(previous: &mut [Quat], rotations: impl Iterator<Item = &'a mut Quat>) {
    for (q, previous) in rotations.zip(previous) {
        *q = if q.dot(*previous) < 0.0 { -*q } else { *q };
        *previous = *q;
    }
}

/// The shortest rotation that turns the direction of `from` into that of `to`; none where one of
/// them has no direction.
pub(super) fn swing(from: Vec3, to: Vec3) -> Quat {
    let (from, to) = match (from.try_normalize(), to.try_normalize()) {
        (Some(from), Some(to)) => (from, to),
        _ => return Quat::IDENTITY,
    };
    let w = 1.0 + from.dot(to);
    if w < 1e-6 {
        return Quat::from_axis_angle(from.any_orthonormal_vector(), std::f32::consts::PI);
    }
    let v = from.cross(to);
    Quat::from_xyzw(v.x, v.y, v.z, w).normalize()
}

/// Where to point the upper bone of a limb, from its joint: the place `e` of the middle joint, at
/// the bone's length, that minimises `l1^2 angle(e, middle)^2 + END_WEIGHT (|end - e| - l2)^2`.
///
/// The second term is the error of the limb's end once the lower bone points at `end`. By symmetry
/// the optimum lies in the plane of the three decoded joints, so it is one angle `t` from the line
/// to the end, found by Gauss-Newton. A limb that is nearly straight has no leverage (`d'` is
/// small), so it is not bent to hide a centimetre, and a limb without a plane (straight) is pointed
/// as decoded; both are continuous in the input.
fn limb_target(middle: Vec3, end: Vec3, (l1, l2): (f32, f32)) -> Vec3 {
    let far = end.length();
    let Some(u) = end.try_normalize() else { return middle };
    let along = middle.dot(u);
    let aside = middle - along * u;
    let height = aside.length();
    if height < 1e-6 || l1 < 1e-6 || far < 1e-6 {
        return middle;
    }
    let decoded = libm::atan2f(height, along);
    let mut t = decoded;
    for _ in 0..LIMB_STEPS {
        let (s, c) = libm::sincosf(t);
        let d = (l1 * l1 + far * far - 2.0 * l1 * far * c).max(1e-12).sqrt();
        let slope = l1 * far * s / d;
        let gradient = l1 * l1 * (t - decoded) + END_WEIGHT * (d - l2) * slope;
        t -= (gradient / (l1 * l1 + END_WEIGHT * slope * slope)).clamp(-0.5, 0.5);
        t = t.clamp(0.0, std::f32::consts::PI);
    }
    let (s, c) = libm::sincosf(t);
    l1 * (c * u + s * aside / height)
}

#[cfg(test)]
mod tests;
