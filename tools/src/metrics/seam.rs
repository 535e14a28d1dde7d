//! Seams between blocks.

use super::mean;
use visavis::{BLOCK_FRAMES, Frame};

/// Mean joint acceleration across block boundaries over that inside blocks; 1 means seamless.
///
/// Acceleration is the second difference of world positions. Of a block's four centred differences
/// two reach over a boundary (around its first and its last frame) and two lie inside. `None` for
/// less than a block, or when nothing inside blocks accelerates (below 1e-9 m/frame²), where the
/// ratio says nothing.
pub fn seam(frames: &[Frame]) -> Option<f64> {
    ratio(frames, |w| crosses(w[1].index))
}

/// The same across those boundaries alone at which the sampler changes: how well a governor's steps
/// are hidden. `None` where it never changes, and as [`seam`].
pub fn switch_seam(frames: &[Frame]) -> Option<f64> {
    ratio(frames, |w| crosses(w[1].index) && w[0].sampler != w[2].sampler)
}

/// Mean acceleration around the frames that `counts` picks, over that inside blocks.
fn ratio(frames: &[Frame], counts: impl Fn(&[Frame]) -> bool) -> Option<f64> {
    let acceleration = |counts: &dyn Fn(&[Frame]) -> bool| {
        mean(frames.windows(3).filter(|w| counts(w)).flat_map(|w| {
            let joints = w[0].global.iter().zip(&w[1].global).zip(&w[2].global);
            joints.map(|((a, b), c)| f64::from((a.position - 2.0 * b.position + c.position).length()))
        }))
    };
    let inside = acceleration(&|w| !crosses(w[1].index))?;
    let across = acceleration(&counts)?;
    (inside > 1e-9).then(|| across / inside)
}

/// Whether the centred second difference around frame `index` reaches over a block boundary.
fn crosses(index: u64) -> bool {
    let slot = index % BLOCK_FRAMES as u64;
    slot == 0 || slot == BLOCK_FRAMES as u64 - 1
}

#[cfg(test)]
mod tests {
    use super::super::testing::{close, recording};
    use super::*;

    #[test]
    fn uniform_acceleration_is_seamless() {
        let r = recording(40, |_, t, p| p.iter_mut().for_each(|p| p.x += 3.0 * t * t));
        close(seam(&r.frames).unwrap(), 1.0, 1e-2);
    }

    #[test]
    fn a_jump_at_every_boundary_is_counted() {
        // Inside blocks x = k² / 4 gives 0.5; each boundary adds a step of 1 to both differences
        // that reach over it. Around the first frame of a block the step counts -1, around the last
        // +1: |0.5 - 1| and |0.5 + 1|, mean 1.
        let r = recording(42, |i, _, p| {
            p.iter_mut().for_each(|p| p.x += 0.25 * (i * i) as f32 + (i / BLOCK_FRAMES) as f32);
        });
        close(seam(&r.frames).unwrap(), 2.0, 1e-4);
    }

    #[test]
    fn blocks_are_counted_from_the_frame_number() {
        let mut r = recording(41, |i, _, p| p[0].x += 0.25 * (i * i) as f32 + (i / BLOCK_FRAMES) as f32);
        let aligned = seam(&r.frames).unwrap();
        r.frames.iter_mut().for_each(|f| f.index += 2);
        assert!(seam(&r.frames).unwrap() < 0.7 * aligned);
    }

    #[test]
    fn switches_are_measured_where_they_are() {
        let still = |i: usize, _: f32, p: &mut [glam::Vec3]| p.iter_mut().for_each(|p| p.x += 0.25 * (i * i) as f32);
        // A jump at one boundary, where the sampler changes or where it does not.
        let jumping = |i: usize, t: f32, p: &mut [glam::Vec3]| {
            still(i, t, p);
            p.iter_mut().for_each(|p| p.x += if i < 20 { 0.0 } else { 1.0 });
        };
        let mut r = recording(40, still);
        assert_eq!(switch_seam(&r.frames), None, "one sampler");
        r.frames[24..].iter_mut().for_each(|f| f.sampler = visavis::Sampler::Single);
        close(switch_seam(&r.frames).unwrap(), 1.0, 1e-3);
        let mut r = recording(40, jumping);
        r.frames[20..].iter_mut().for_each(|f| f.sampler = visavis::Sampler::Single);
        close(switch_seam(&r.frames).unwrap(), 2.0, 1e-3);
        assert!(seam(&r.frames).unwrap() < 1.2);
    }

    #[test]
    fn nothing_to_measure_is_none() {
        assert_eq!(seam(&recording(3, |_, t, p| p[0].x += t * t).frames), None);
        assert_eq!(seam(&recording(40, |_, _, _| {}).frames), None);
    }
}
