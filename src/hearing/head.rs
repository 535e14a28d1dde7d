//! What two ears hear of a source somewhere: delay, shadow of the head, distance.
//!
//! As `audio/ears.rs` for whole clips, but streaming, at a head that moves, without a room; the
//! delay that both ears have in common is left out.

use crate::audio::head::{BEND, NEAREST, RADIUS, SPEED, around, brightness};
use crate::frame::{FRAME_SAMPLES, SAMPLE_RATE, Transform};

/// Samples before a frame that its own sound may be delayed by: the longest delay is 15.7.
pub(super) const PAST: usize = 20;

/// The head in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Head {
    /// Its centre, world metres.
    centre: [f64; 3],
    /// Directions of the left ear and of the face.
    left: [f64; 3],
    front: [f64; 3],
}

/// How a place is heard.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path {
    /// Distance, metres, at least 0.3.
    pub(super) distance: f64,
    /// 1 over it.
    gain: f32,
    /// Of the left and the right ear: delay, samples, and high-frequency gain.
    delay: [f32; 2],
    high: [f32; 2],
}

impl Head {
    /// That of the head joint's transform; the centre is `height` metres over it, along the head.
    pub(super) fn new(joint: &Transform, height: f64) -> Self {
        let [x, y, z, w] = joint.rotation.to_array().map(f64::from);
        let up = [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)];
        let left = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)];
        let front = [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)];
        let at = joint.position.to_array();
        Self { centre: [0, 1, 2].map(|i| f64::from(at[i]) + height * up[i]), left, front }
    }

    pub(super) fn centre(&self) -> [f64; 3] {
        self.centre
    }

    /// Cosines of the angles between a direction and those of the left ear and of the face.
    pub(super) fn sides(&self, direction: [f64; 3]) -> [f64; 2] {
        [self.left, self.front].map(|axis| (0..3).map(|i| axis[i] * direction[i]).sum())
    }

    /// How the place `source` (world metres) is heard.
    pub(super) fn path(&self, source: [f64; 3]) -> Path {
        let d = [0, 1, 2].map(|i| source[i] - self.centre[i]);
        let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let along = (d[0] * self.left[0] + d[1] * self.left[1] + d[2] * self.left[2]) / r.max(1e-6);
        let distance = r.max(NEAREST);
        let [delay, high] = ears_at(along).map(|ears| ears.map(|value| value as f32));
        Path { distance, gain: (1.0 / distance) as f32, delay, high }
    }
}

/// Delay in samples and high-frequency gain of the left and the right ear for what comes from
/// where the left ear's axis has an angle of this `cosine`.
pub(super) fn ears_at(cosine: f64) -> [[f64; 2]; 2] {
    let angles = [cosine, -cosine].map(|cosine| libm::acos(cosine.clamp(-1.0, 1.0)));
    [angles.map(|angle| f64::from(SAMPLE_RATE) * RADIUS / SPEED * (1.0 + around(angle))), angles.map(brightness)]
}

/// What a source's sound has left behind at the ears.
#[derive(Debug, Clone, Default)]
pub(super) struct Trail {
    /// How it was heard in the frame before; none at a beginning.
    before: Option<Path>,
    /// Last samples of the source.
    pub(super) past: [f32; PAST],
    /// Last sample at each ear before and after the shadow.
    x: [f32; 2],
    y: [f32; 2],
}

impl Trail {
    /// Adds a frame of the source at `path` to both ears. `sound` holds the [`PAST`] samples before
    /// the frame and the frame's; delay, shadow and distance go from those of the frame before to
    /// those of `path` in a straight line.
    pub(super) fn add(&mut self, path: &Path, sound: &[f32], ears: [&mut [f32]; 2]) {
        const Q: f32 = BEND as f32;
        const SCALE: f32 = 1.0 / (1.0 + Q);
        let before = self.before.replace(*path).unwrap_or(*path);
        let rise = path.gain - before.gain;
        for (ear, heard) in ears.into_iter().enumerate() {
            let (d, a) = (before.delay[ear], before.high[ear]);
            let (later, brighter) = (path.delay[ear] - d, path.high[ear] - a);
            let (mut last_x, mut last_y) = (self.x[ear], self.y[ear]);
            for (i, heard) in heard.iter_mut().enumerate() {
                let part = (i + 1) as f32 / FRAME_SAMPLES as f32;
                let delay = d + later * part;
                let whole = delay as usize;
                let (near, far) = (sound[PAST + i - whole], sound[PAST + i - whole - 1]);
                let x = near + (delay - whole as f32) * (far - near);
                let bright = (a + brighter * part) * Q;
                let y = ((1.0 + bright) * x + (1.0 - bright) * last_x + (Q - 1.0) * last_y) * SCALE;
                *heard += y * (before.gain + rise * part);
                (last_x, last_y) = (x, y);
            }
            (self.x[ear], self.y[ear]) = (last_x, last_y);
        }
    }
}

/// 10 log10 of the mean square of `samples`, dB SPL; 24 dB for silence. Sums in eight lanes: a
/// fixed order that vectors take too.
pub(super) fn level(samples: &[f32]) -> f64 {
    let mut lanes = [0.0f64; 8];
    for piece in samples.chunks(8) {
        lanes.iter_mut().zip(piece).for_each(|(lane, s)| *lane += f64::from(*s) * f64::from(*s));
    }
    10.0 * libm::log10(lanes.iter().sum::<f64>() / samples.len() as f64 + 1e-7) + 94.0
}
