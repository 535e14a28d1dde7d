//! The types that pass between stages and to the caller.

mod sampler;

pub use sampler::{EulerSteps, Sampler};

use glam::{Quat, Vec3};

/// Frames of motion a second.
pub const FPS: u32 = 30;
/// Frames in a block, the unit that is generated at once (133.3 ms).
pub const BLOCK_FRAMES: usize = 4;
/// Sample rate inside the runtime, Hz.
pub const SAMPLE_RATE: u32 = 24_000;
/// Audio samples in a frame.
pub const FRAME_SAMPLES: usize = (SAMPLE_RATE / FPS) as usize;
/// Audio samples in a block.
pub const BLOCK_SAMPLES: usize = FRAME_SAMPLES * BLOCK_FRAMES;
/// Explicit root channels at the head of a pose feature vector: `vx`, `vz` (m/frame), `dyaw`
/// (rad/frame).
pub const ROOT_CHANNELS: usize = 3;
/// Feature channels of a joint: 12 icosahedron vertices of 3 coordinates.
pub const JOINT_CHANNELS: usize = 36;

/// Length F of the feature vector of `joints` joints: `3 + 36 joints`.
pub const fn feature_count(joints: usize) -> usize {
    ROOT_CHANNELS + JOINT_CHANNELS * joints
}

/// A joint's place in space: metres, right-handed, Y up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    /// Position, metres.
    pub position: Vec3,
    /// Rotation from the joint's rest orientation (unit quaternion, `x, y, z, w`).
    pub rotation: Quat,
}

impl Transform {
    /// At the origin, unrotated.
    pub const IDENTITY: Self = Self { position: Vec3::ZERO, rotation: Quat::IDENTITY };
}

/// Where the agent stands: the floor projection of the hips, and the heading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Root {
    /// X on the floor, metres.
    pub x: f64,
    /// Z on the floor, metres.
    pub z: f64,
    /// Heading, radians: the agent faces `(sin yaw, 0, cos yaw)`.
    pub yaw: f64,
}

impl Root {
    /// Maps a point of the heading frame of this root to the world.
    pub fn to_world(&self, p: Vec3) -> Vec3 {
        let (s, c) = libm::sincos(self.yaw);
        let (x, z) = (f64::from(p.x), f64::from(p.z));
        Vec3::new((self.x + c * x + s * z) as f32, p.y, (self.z - s * x + c * z) as f32)
    }

    /// Maps a point of the world to the heading frame of this root.
    pub fn to_local(&self, p: Vec3) -> Vec3 {
        let (s, c) = libm::sincos(self.yaw);
        let (x, z) = (f64::from(p.x) - self.x, f64::from(p.z) - self.z);
        Vec3::new((c * x - s * z) as f32, p.y, (s * x + c * z) as f32)
    }

    /// The heading as a rotation about Y.
    pub fn rotation(&self) -> Quat {
        Quat::from_rotation_y(self.yaw as f32)
    }

    /// The root one frame later: moved by `(vx, vz)` of this root's heading frame and turned by
    /// `dyaw`.
    #[must_use]
    pub fn advanced(&self, vx: f32, vz: f32, dyaw: f32) -> Self {
        let (s, c) = libm::sincos(self.yaw);
        let (vx, vz) = (f64::from(vx), f64::from(vz));
        let yaw = self.yaw + f64::from(dyaw);
        let turn = std::f64::consts::TAU;
        Self { x: self.x + c * vx + s * vz, z: self.z - s * vx + c * vz, yaw: yaw - turn * (yaw / turn).round() }
    }
}

/// One frame of motion for the caller, in world coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Frame number since the session started; frame `i` is shown from `i / 30` s on.
    pub index: u64,
    /// Session time at which the frame is shown, seconds.
    pub time: f64,
    /// Where the agent stands.
    pub root: Root,
    /// Decoded transform of each joint, joints as in the rig.
    pub global: Vec<Transform>,
    /// World position of the hips for the fixed-bone-length rig, metres.
    pub hips: Vec3,
    /// Rotation of each joint relative to its parent on the fixed-bone-length rig (hips: relative
    /// to the world).
    pub local: Vec<Quat>,
    /// Largest distance between a decoded joint position and the rig's, metres.
    pub fit_error: f32,
    /// Gaze score in this frame, -1 to 1, or `None` while the user's position is not known.
    pub gaze: Option<f32>,
    /// What made this frame; of bundles without samplers the one that was set.
    pub sampler: Sampler,
    /// How much of the frame is a held pose instead of the model's, 0 to 1: while the model cannot
    /// keep up, or gave what no body can do, and in the cross-fade after that.
    pub held: f32,
    /// How much each joint follows the user rather than the agent's own voice and habit, 0 to 1,
    /// joints as in the rig: the read-out of bundles of the kind `dram`; empty for others (of a
    /// session with a fallback, where that did not make the frame), and zeros while a pose is held
    /// instead of computed.
    pub dyadic: Vec<f32>,
}

impl Frame {
    /// A frame of `joints` joints at rest, for buffers that are filled later.
    pub fn empty(joints: usize) -> Self {
        Self {
            index: 0,
            time: 0.0,
            root: Root::default(),
            global: vec![Transform::IDENTITY; joints],
            hips: Vec3::ZERO,
            local: vec![Quat::IDENTITY; joints],
            fit_error: 0.0,
            gaze: None,
            sampler: Sampler::Midpoint4,
            held: 0.0,
            dyadic: Vec::new(),
        }
    }
}
