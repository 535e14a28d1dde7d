//! Frames as C sees them.

use crate::options::sampler_numbers;
use crate::status::{Failure, Outcome, VisavisStatus};
use visavis::Frame;

/// One frame of motion, without its joints. World coordinates: metres, right-handed, Y up.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct VisavisFrame {
    /// Number of the frame since the session started.
    pub index: u64,
    /// Session time at which it is shown, seconds: index / 30.
    pub time: f64,
    /// Where the agent stands: floor projection of the hips.
    pub root_x: f64,
    /// See root_x.
    pub root_z: f64,
    /// Heading, radians: the agent faces (sin yaw, 0, cos yaw).
    pub root_yaw: f64,
    /// Position of the hips of the rig with fixed bone lengths.
    pub hips: [f32; 3],
    /// Largest distance between a decoded joint and the rig's, metres.
    pub fit_error: f32,
    /// Gaze score, -1 to 1; NaN while the user's position is not known.
    pub gaze: f32,
    /// What made this frame: a visavis_sampler_kind; -1: something newer.
    pub sampler_kind: i32,
    /// Steps of that sampler.
    pub sampler_steps: u32,
    /// How much of the frame is a held pose instead of the model's, 0 to 1.
    pub held: f32,
    /// Of test builds.
    #[cfg(feature = "grown")]
    pub grown: u64,
}

/// Size of a frame as it was first published: a literal, so that it stays when the struct grows.
const FIRST: usize = 72;
const _: () = assert!(size_of::<VisavisFrame>() >= FIRST);
// Nothing tells its size, so it cannot grow.
const _: () = assert!(size_of::<VisavisJoint>() == 44);

/// One joint of a frame. Quaternions are x, y, z, w.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct VisavisJoint {
    /// Rotation relative to the parent on the rig with fixed bone lengths (hips: relative to the
    /// world): for humanoid rigs.
    pub local: [f32; 4],
    /// Decoded position in the world.
    pub position: [f32; 3],
    /// Decoded rotation in the world, from the T-pose.
    pub rotation: [f32; 4],
}

impl VisavisFrame {
    pub(crate) fn of(f: &Frame) -> Self {
        let (sampler_kind, sampler_steps) = sampler_numbers(f.sampler);
        Self {
            index: f.index,
            time: f.time,
            root_x: f.root.x,
            root_z: f.root.z,
            root_yaw: f.root.yaw,
            hips: f.hips.to_array(),
            fit_error: f.fit_error,
            gaze: f.gaze.unwrap_or(f32::NAN),
            sampler_kind,
            sampler_steps,
            held: f.held,
            #[cfg(feature = "grown")]
            grown: crate::structs::GROWN,
        }
    }

    /// Refuses sizes that no caller's frame has.
    pub(crate) fn check_size(size: usize) -> Outcome {
        if (FIRST..=4096).contains(&size) && size.is_multiple_of(align_of::<Self>()) {
            return Ok(());
        }
        let message = format!("frame_size is {size}: pass sizeof(visavis_frame)");
        Err(Failure::new(VisavisStatus::Abi, message))
    }

    /// Writes as much of the frame as the caller's struct of `size` bytes holds; bytes beyond are
    /// zeroed.
    ///
    /// # Safety
    /// `to` has room for `size` bytes.
    pub(crate) unsafe fn write(&self, to: *mut u8, size: usize) {
        let known = size.min(size_of::<Self>());
        // SAFETY: `known` bytes are inside both; what follows, up to `size`, is the caller's
        // promise.
        unsafe {
            to.copy_from_nonoverlapping((&raw const *self).cast::<u8>(), known);
            to.add(known).write_bytes(0, size - known);
        }
    }
}

/// The joints of a frame.
pub(crate) fn joints_of(f: &Frame) -> impl Iterator<Item = VisavisJoint> {
    f.global.iter().zip(&f.local).map(|(global, local)| VisavisJoint {
        local: local.to_array(),
        position: global.position.to_array(),
        rotation: global.rotation.to_array(),
    })
}
