//! Feature vectors to world transforms and back.

use super::bridge::Bridge;
use super::fit::follow;
use super::guard::{Guard, GuardStats};
use super::icosahedron::{decode, encode};
use super::stance::Stance;
use super::{Fit, Rig};
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, Frame, JOINT_CHANNELS, ROOT_CHANNELS, Root, Transform, feature_count};
use crate::kernels::Kernels;
use crate::normaliser::Metric;
use crate::par::Pool;
use glam::{Mat3, Quat};

/// Joints that one thread makes transforms of at a time: as many as go through the polar factors
/// side by side, twice.
const LOT: usize = 32;

/// Streaming decoder of feature vectors: integrates the root, places the joints in the world and
/// fits the rig.
///
/// A feature vector `x` holds `F = 3 + 36 J` values: `(vx, vz)` the root's displacement since the
/// frame before in that frame's heading frame (m/frame), `dyaw` the turn (rad/frame), then for each
/// joint the 12 vertices of its icosahedron ([`super::icosahedron`]) in *this* frame's heading
/// frame (origin: the root on the floor; +Z: the heading).
///
/// Decoding allocates nothing, provided that the frame's buffers have room for J joints
/// ([`Frame::empty`]).
#[derive(Debug, Clone)]
pub struct Decoder {
    radius: f32,
    root: Root,
    fit: Fit,
    bridge: Option<Bridge>,
    stance: Option<Stance>,
    guard: Guard,
    /// Whether poses are judged; else the guard only holds.
    guarded: bool,
    kernels: Kernels,
    /// Joints of a block's frames, each frame's in its heading frame, `[4, J]`, and a rest up to
    /// whole lots.
    joints: Vec<Transform>,
    /// The root's step to each of them, and the root.
    steps: [[f32; ROOT_CHANNELS]; BLOCK_FRAMES],
    roots: [Root; BLOCK_FRAMES],
    /// Scratch of the fit, for each of two threads.
    placed: [Vec<Transform>; 2],
    /// World rotations of the frame before, for the signs of the quaternions.
    previous: Vec<Quat>,
}

impl Decoder {
    /// A decoder for `rig` and icosahedra of circumradius `radius` (metres), with the root at the
    /// origin facing +Z.
    pub fn new(kernels: Kernels, rig: &Rig, radius: f32) -> Self {
        let n = rig.len();
        Self {
            radius,
            root: Root::default(),
            fit: Fit::new(kernels, rig),
            bridge: None,
            stance: None,
            guard: Guard::new(rig),
            guarded: false,
            kernels,
            joints: vec![Transform::IDENTITY; (BLOCK_FRAMES * n).next_multiple_of(LOT)],
            steps: [[0.0; ROOT_CHANNELS]; BLOCK_FRAMES],
            roots: [Root::default(); BLOCK_FRAMES],
            placed: [(); 2].map(|()| vec![Transform::IDENTITY; n]),
            previous: vec![Quat::IDENTITY; n],
        }
    }

    /// The same with borders between blocks bridged (`bridge.rs`): a difference dies away with the
    /// time constant `frames`.
    #[must_use]
    pub fn with_bridge(mut self, rig: &Rig, frames: f32) -> Self {
        self.bridge = Some(Bridge::new(rig, frames));
        self
    }

    /// The same with planted feet held where they are (`stance.rs`).
    #[must_use]
    pub fn with_stance(mut self, rig: &Rig) -> Self {
        self.stance = Some(Stance::new(rig));
        self
    }

    /// The same with frames that no body could show replaced (`guard.rs`); decoding then never
    /// fails.
    #[must_use]
    pub fn with_guard(mut self) -> Self {
        self.guarded = true;
        self
    }

    /// What the guard met since the last reset.
    pub fn guard_stats(&self) -> GuardStats {
        self.guard.stats()
    }

    /// Length F of a feature vector.
    pub fn feature_count(&self) -> usize {
        feature_count(self.previous.len())
    }

    /// The root of the last frame.
    pub fn root(&self) -> Root {
        self.root
    }

    /// Starts again from `root`, as if it were the root of the frame before the next.
    pub fn reset(&mut self, root: Root) {
        self.root = root;
        self.fit.reset();
        self.bridge.iter_mut().for_each(Bridge::reset);
        self.stance.iter_mut().for_each(Stance::reset);
        self.guard.reset();
        self.previous.fill(Quat::IDENTITY);
    }

    /// Takes the pose of `x`, one feature vector, for the one before the first frame: it is held
    /// where the first one is not plausible.
    ///
    /// # Panics
    /// If `x` is not F long.
    pub fn prime(&mut self, x: Metric<&[f32]>) {
        let x = x.values();
        assert_eq!(x.len(), self.feature_count(), "a feature vector has 3 + 36 J values");
        self.transforms(None, x);
        self.guard.prime(&self.joints[..self.previous.len()]);
    }

    /// As [`Decoder::prime`], of joints in their heading frame.
    ///
    /// # Panics
    /// If there are not J of them.
    pub fn prime_joints(&mut self, joints: &[Transform]) {
        assert_eq!(joints.len(), self.previous.len(), "one transform a joint");
        self.guard.prime(joints);
    }

    /// As [`Decoder::decode_block_on`], of joints instead of features: `place` writes those of
    /// frame `i`, each frame's in its heading frame, and returns the root's step to it.
    ///
    /// # Errors
    /// As [`Decoder::decode_block_on`].
    ///
    /// # Panics
    /// If there are more than four frames.
    pub fn joints_block_on(
        &mut self,
        pool: Option<&mut Pool>,
        place: impl Fn(usize, &mut [Transform]) -> [f32; ROOT_CHANNELS],
        frames: &mut [Frame],
    ) -> Result<()> {
        assert!(frames.len() <= BLOCK_FRAMES, "a block has at most four frames");
        let n = self.previous.len();
        for i in 0..frames.len() {
            self.steps[i] = place(i, &mut self.joints[i * n..(i + 1) * n]);
        }
        let joints = &self.joints[..frames.len() * n];
        let finite = joints.iter().all(|j| j.position.is_finite() && j.rotation.is_finite())
            && self.steps[..frames.len()].as_flattened().iter().all(|v| v.is_finite());
        if !self.guarded && !finite {
            return Err(not_finite());
        }
        self.judge(frames);
        self.show(pool, frames);
        Ok(())
    }

    /// Joints of frame `i` of the last block as it was shown, in their heading frame, and the
    /// root's step to it.
    ///
    /// # Panics
    /// If `i` is not below 4.
    pub fn shown_joints(&self, i: usize) -> (&[Transform], [f32; ROOT_CHANNELS]) {
        let n = self.previous.len();
        (&self.joints[i * n..(i + 1) * n], self.steps[i])
    }

    /// Decodes the next frame: advances the root and fills `root`, `global`, `hips`, `local`,
    /// `fit_error` and `held` of `frame`; its other fields are left alone.
    ///
    /// # Errors
    /// As [`Decoder::decode_block`].
    ///
    /// # Panics
    /// If `x` is not F long.
    #[cfg(feature = "internals")]
    pub fn decode(&mut self, x: Metric<&[f32]>, frame: &mut Frame) -> Result<()> {
        self.decode_block(x, std::slice::from_mut(frame))
    }

    /// Decodes the next block of up to four frames, `x` `[frames, F]`, as [`Decoder::decode`] does
    /// one. Between the features and the frames, in this order: what is not plausible is replaced,
    /// the border to the block before is bridged, then planted feet are held.
    ///
    /// # Errors
    /// [`ErrorKind::State`] if a value of `x` is not finite and there is no guard; the decoder is
    /// then as before and `frames` untouched.
    ///
    /// # Panics
    /// If there are more than four frames, or `x` does not have as many vectors of length F.
    #[cfg(feature = "internals")]
    pub fn decode_block(&mut self, x: Metric<&[f32]>, frames: &mut [Frame]) -> Result<()> {
        self.decode_block_on(None, x, frames)
    }

    /// The same on the threads of `pool`, as far as frames do not depend on each other; with the
    /// same bits.
    ///
    /// # Errors
    /// As [`Decoder::decode_block`].
    ///
    /// # Panics
    /// As [`Decoder::decode_block`].
    pub fn decode_block_on(
        &mut self,
        mut pool: Option<&mut Pool>,
        x: Metric<&[f32]>,
        frames: &mut [Frame],
    ) -> Result<()> {
        let x = x.values();
        let width = self.feature_count();
        assert!(frames.len() <= BLOCK_FRAMES, "a block has at most four frames");
        assert_eq!(x.len(), width * frames.len(), "a feature vector has 3 + 36 J values");
        if !self.guarded && !x.iter().all(|v| v.is_finite()) {
            return Err(not_finite());
        }
        self.transforms(pool.as_deref_mut(), x);
        for i in 0..frames.len() {
            self.steps[i] = [0, 1, 2].map(|c| x[i * width + c]);
        }
        self.judge(frames);
        self.show(pool, frames);
        Ok(())
    }

    /// Lets the guard, if there is one, judge the joints and steps of `frames`.
    fn judge(&mut self, frames: &mut [Frame]) {
        let n = self.previous.len();
        for (i, frame) in frames.iter_mut().enumerate() {
            let joints = &mut self.joints[i * n..(i + 1) * n];
            frame.held = if self.guarded { self.guard.check(joints, &mut self.steps[i]) } else { 0.0 };
        }
    }

    /// Up to four frames for which there are no usable features: the guard treats them as it does
    /// features that are not finite.
    ///
    /// # Panics
    /// If there are more than four frames, or no guard.
    pub fn miss_block_on(&mut self, pool: Option<&mut Pool>, frames: &mut [Frame]) {
        assert!(self.guarded, "only a guarded decoder can do without features");
        let n = self.previous.len();
        for (i, frame) in frames.iter_mut().enumerate() {
            frame.held = self.guard.miss(&mut self.joints[i * n..(i + 1) * n], &mut self.steps[i]);
        }
        self.show(pool, frames);
    }

    /// Up to four frames without features: motion eases into a held, breathing pose. Decoding goes
    /// on from there in a cross-fade, as if there had been no time between.
    ///
    /// # Panics
    /// If there are more than four frames.
    pub fn hold_block(&mut self, frames: &mut [Frame]) {
        let n = self.previous.len();
        for (i, frame) in frames.iter_mut().enumerate() {
            self.guard.hold(&mut self.joints[i * n..(i + 1) * n], &mut self.steps[i]);
            frame.held = 1.0;
        }
        self.show(None, frames);
    }

    /// What comes next is another generator's: a guarded decoder comes over to it in a cross-fade.
    pub fn cross_fade(&mut self) {
        if self.guarded {
            self.guard.cross_fade();
        }
    }

    /// Makes `frames` of `joints` and `steps`.
    fn show(&mut self, pool: Option<&mut Pool>, frames: &mut [Frame]) {
        let n = self.previous.len();
        if let Some(bridge) = &mut self.bridge
            && !frames.is_empty()
        {
            let second = (frames.len() > 1).then(|| &self.joints[n..2 * n]);
            bridge.start(&self.joints[..n], second, self.steps[0]);
        }
        for (i, step) in self.steps[..frames.len()].iter_mut().enumerate() {
            let joints = &mut self.joints[i * n..(i + 1) * n];
            if let Some(bridge) = &mut self.bridge {
                bridge.apply(joints, step);
            }
            if let Some(stance) = &mut self.stance {
                *step = stance.hold(joints, *step);
            }
            let [vx, vz, dyaw] = *step;
            self.root = self.root.advanced(vx, vz, dyaw);
            self.roots[i] = self.root;
        }
        let Self { joints, roots, fit, placed, .. } = &mut *self;
        let fit = &*fit;
        each(pool, placed, frames, |placed, i, frame| {
            let joints = &joints[i * n..(i + 1) * n];
            place(joints, &roots[i], frame);
            fit.turn(placed, joints, &roots[i], frame);
        });
        for frame in frames {
            follow(&mut self.previous, frame.global.iter_mut().map(|joint| &mut joint.rotation));
            self.fit.sign(frame);
        }
    }

    /// Writes the feature vectors of the last block as it was shown, `x` `[frames, F]`.
    ///
    /// # Panics
    /// If `x` does not have up to four vectors of length F.
    pub fn shown(&self, mut x: Metric<&mut [f32]>) {
        let x = x.values_mut();
        let (n, width) = (self.previous.len(), self.feature_count());
        assert!(
            x.len().is_multiple_of(width) && x.len() <= BLOCK_FRAMES * width,
            "up to four vectors of 3 + 36 J values"
        );
        for ((x, joints), step) in x.chunks_exact_mut(width).zip(self.joints.chunks_exact(n)).zip(&self.steps) {
            let (head, vertices) = x.split_at_mut(ROOT_CHANNELS);
            head.copy_from_slice(step);
            for (joint, vertices) in joints.iter().zip(vertices.as_chunks_mut::<JOINT_CHANNELS>().0) {
                encode(joint, self.radius, vertices);
            }
        }
    }

    /// Fills the first of `joints` from the feature vectors in `x`.
    fn transforms(&mut self, pool: Option<&mut Pool>, x: &[f32]) {
        let (n, width) = (self.previous.len(), self.feature_count());
        let count = x.len() / width * n;
        let (kernels, radius) = (self.kernels, self.radius);
        let lots = &mut self.joints.as_chunks_mut::<LOT>().0[..count.div_ceil(LOT)];
        each(pool, &mut [(), ()], lots, |(), lot, joints| {
            let first = lot * LOT;
            let joints = &mut joints[..LOT.min(count - first)];
            let (mut maps, mut rotations) = ([[0.0; 9]; LOT], [[0.0; 9]; LOT]);
            for (i, (joint, map)) in joints.iter_mut().zip(&mut maps).enumerate() {
                let (frame, j) = ((first + i) / n, (first + i) % n);
                let vertices = x[frame * width + ROOT_CHANNELS..][..n * JOINT_CHANNELS].as_chunks().0;
                (joint.position, *map) = decode(&vertices[j], radius);
            }
            kernels.polar(&maps[..joints.len()], &mut rotations[..joints.len()]);
            for (joint, r) in joints.iter_mut().zip(&rotations) {
                joint.rotation = Quat::from_mat3(&Mat3::from_cols_array(r).transpose()).normalize();
            }
        });
    }
}

fn not_finite() -> Error {
    Error::new(
        ErrorKind::State,
        "the model gave a pose that is not finite; reset the session, and check the bundle if it happens again",
    )
}

/// Calls `work` for each of `items` with one of the `tools`, on the threads of `pool` if there is
/// one.
fn each<S: Send, T: Send>(
    pool: Option<&mut Pool>,
    tools: &mut [S; 2],
    items: &mut [T],
    work: impl Fn(&mut S, usize, &mut T) + Sync,
) {
    match pool {
        Some(pool) => pool.each_with(tools, items, work),
        None => items.iter_mut().enumerate().for_each(|(i, item)| work(&mut tools[0], i, item)),
    }
}

/// Writes `joints`, in the heading frame of `root`, to `frame` as world transforms, but for the
/// signs of the rotations.
fn place(joints: &[Transform], root: &Root, frame: &mut Frame) {
    let heading = root.rotation();
    frame.root = *root;
    frame.global.resize(joints.len(), Transform::IDENTITY);
    for (world, joint) in frame.global.iter_mut().zip(joints) {
        let rotation = (heading * joint.rotation).normalize();
        *world = Transform { position: root.to_world(joint.position), rotation };
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Encoder, synthetic};
    use super::*;

    const RADIUS: f32 = 0.1;

    fn features(frames: &[Frame]) -> Vec<Metric> {
        let mut encoder = Encoder::new(RADIUS);
        let encode = |f: &Frame| {
            let mut x = Metric::zeros(feature_count(f.global.len()));
            encoder.encode(f.root, &f.global, x.view_mut());
            x
        };
        frames.iter().map(encode).collect()
    }

    #[test]
    fn with_and_without_a_pool_are_the_same_bits() {
        let recording = synthetic::walk(160);
        let (n, width) = (recording.rig.len(), feature_count(recording.rig.len()));
        let mut x: Vec<f32> = features(&recording.frames).into_iter().flat_map(Metric::into_inner).collect();
        // A frame that no body can show, and joints off their bones.
        x[70 * width..71 * width].fill(f32::NAN);
        x.iter_mut().enumerate().for_each(|(i, v)| *v += 0.01 * (i as f32 * 0.7).sin());
        let decoder = || {
            let decoder = Decoder::new(Kernels::detect().unwrap(), &recording.rig, RADIUS);
            decoder.with_bridge(&recording.rig, 0.8).with_stance(&recording.rig).with_guard()
        };
        let (mut alone, mut pool) = (decoder(), Pool::new(2).unwrap());
        let mut shared = decoder();
        pool.begin();
        for (block, x) in x.chunks(BLOCK_FRAMES * width).enumerate() {
            // Blocks of all sizes up to four frames.
            for x in x.chunks((1 + block % BLOCK_FRAMES) * width) {
                let mut expected = vec![Frame::empty(n); x.len() / width];
                let mut frames = expected.clone();
                alone.decode_block(Metric::new(x), &mut expected).unwrap();
                shared.decode_block_on(Some(&mut pool), Metric::new(x), &mut frames).unwrap();
                assert_eq!(frames, expected, "block {block}");
            }
        }
        pool.end();
        assert!(alone.guard_stats().trips > 0);
    }

    #[test]
    fn transforms_survive_the_round_trip() {
        let recording = synthetic::walk(300);
        let mut decoder = Decoder::new(Kernels::detect().unwrap(), &recording.rig, RADIUS);
        decoder.reset(recording.frames[0].root);
        let mut out = Frame::empty(recording.rig.len());
        for (x, frame) in features(&recording.frames).iter().zip(&recording.frames) {
            decoder.decode(x.view(), &mut out).unwrap();
            assert!((out.root.x - frame.root.x).hypot(out.root.z - frame.root.z) < 1e-5);
            for (a, b) in out.global.iter().zip(&frame.global) {
                assert!(a.position.distance(b.position) < 1e-5, "{} {}", a.position, b.position);
                assert!(a.rotation.dot(b.rotation).abs() > 1.0 - 1e-5);
            }
            assert!(out.fit_error < 1e-5, "{}", out.fit_error);
            assert!(out.hips.distance(frame.hips) < 1e-5);
        }
    }

    #[test]
    fn features_survive_the_round_trip() {
        let recording = synthetic::walk(60);
        let expected = features(&recording.frames);
        let mut decoder = Decoder::new(Kernels::detect().unwrap(), &recording.rig, RADIUS);
        // From elsewhere, with a heading close to the seam at half a turn.
        decoder.reset(Root { x: -31.0, z: 12.5, yaw: 3.0 });
        let mut encoder = Encoder::new(RADIUS);
        encoder.reset(Some(decoder.root()));
        let mut frame = Frame::empty(recording.rig.len());
        let mut x = Metric::zeros(decoder.feature_count());
        for e in &expected {
            decoder.decode(e.view(), &mut frame).unwrap();
            encoder.encode(frame.root, &frame.global, x.view_mut());
            for (c, (a, b)) in x.values().iter().zip(e.values()).enumerate() {
                assert!((a - b).abs() < 1e-5, "channel {c}: {a} {b}");
            }
        }
    }

    #[test]
    fn ten_minutes_do_not_drift() {
        let recording = synthetic::walk(18_000);
        let mut decoder = Decoder::new(Kernels::detect().unwrap(), &recording.rig, RADIUS);
        decoder.reset(recording.frames[0].root);
        let mut out = Frame::empty(recording.rig.len());
        for x in features(&recording.frames) {
            decoder.decode(x.view(), &mut out).unwrap();
        }
        let last = recording.frames.last().unwrap().root;
        let off = (out.root.x - last.x).hypot(out.root.z - last.z);
        assert!(off < 1e-4, "{off} m");
    }

    #[test]
    fn refuses_what_is_not_finite_and_goes_on() {
        let recording = synthetic::walk(2);
        let x = features(&recording.frames);
        let mut decoder = Decoder::new(Kernels::detect().unwrap(), &recording.rig, RADIUS);
        let (mut a, mut b) = (Frame::empty(22), Frame::empty(22));
        let mut clean = decoder.clone();
        let mut bad = x[0].clone();
        bad.values_mut()[100] = f32::NAN;
        assert_eq!(decoder.decode(bad.view(), &mut a).unwrap_err().kind(), ErrorKind::State);
        assert_eq!(a, Frame::empty(22));
        for x in &x {
            decoder.decode(x.view(), &mut a).unwrap();
            clean.decode(x.view(), &mut b).unwrap();
            assert_eq!(a, b);
        }
    }
}
