//! Where what two microphones hear of a clip comes from, without a session: for tools and tests
//! that judge the estimate.

use super::head::Head;
use super::sources::Sources;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FPS, Transform};
use glam::Vec3;

/// Where a session would take what stands out to be, at the end of each block of `heads`, a head
/// joint a frame that is the middle of the ears; what is left over of both is not looked at.
///
/// # Errors
/// As [`SoundInput::push_ears`](super::SoundInput::push_ears).
pub fn locate(ears: [&[f32]; 2], rate: u32, heads: &[Transform]) -> Result<Vec<Option<Vec3>>> {
    let mut sources = Sources::new();
    let input = sources.input();
    let mut out = Vec::with_capacity(heads.len() / BLOCK_FRAMES);
    let mut both = Box::new([[0.0; BLOCK_SAMPLES]; 2]);
    for (block, heads) in heads.as_chunks::<BLOCK_FRAMES>().0.iter().enumerate() {
        let until = |block: usize| block * BLOCK_FRAMES * rate as usize / FPS as usize;
        let [left, right] = ears.map(|ear| &ear[until(block).min(ear.len())..until(block + 1).min(ear.len())]);
        input.push_ears(left, right, rate)?;
        sources.begin(block as u64, [0.0; 3]);
        sources.hear(block as u64, &heads.each_ref().map(|head| Head::new(head, 0.0)), &mut both);
        out.push(sources.salient().map(|place| Vec3::from(place.map(|v| v as f32))));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::super::head::{PAST, Trail};
    use super::*;
    use crate::frame::{FRAME_SAMPLES, SAMPLE_RATE};
    use glam::Quat;
    use std::f32::consts::{FRAC_PI_2, PI, TAU};

    const BLOCKS: usize = 20;

    fn noise(samples: usize) -> Vec<f32> {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        (0..samples).map(|_| next()).collect()
    }

    /// Heads that stand at the origin, 1.6 m high, with these yaws.
    fn heads(yaw: impl Fn(usize) -> f32) -> Vec<Transform> {
        let head = |t| Transform { position: Vec3::new(0.0, 1.6, 0.0), rotation: Quat::from_rotation_y(yaw(t)) };
        (0..BLOCKS * BLOCK_FRAMES).map(head).collect()
    }

    /// Noise 2 m from such heads, in the middle half of each eight frames.
    fn heard(azimuth: f32, heads: &[Transform]) -> [Vec<f32>; 2] {
        let place = [2.0 * f64::from(azimuth.sin()), 1.4, 2.0 * f64::from(azimuth.cos())];
        let mut sound = noise(PAST + heads.len() * FRAME_SAMPLES);
        for (i, s) in sound.iter_mut().enumerate() {
            *s *= if matches!(i / FRAME_SAMPLES % 8, 2..6) { 0.3 } else { 0.0 };
        }
        let mut ears = [(); 2].map(|()| vec![0.0; heads.len() * FRAME_SAMPLES]);
        let mut trail = Trail::default();
        for (t, head) in heads.iter().enumerate() {
            let path = Head::new(head, 0.0).path(place);
            let frame = t * FRAME_SAMPLES..(t + 1) * FRAME_SAMPLES;
            let [left, right] = &mut ears;
            trail.add(
                &path,
                &sound[frame.start..][..PAST + FRAME_SAMPLES],
                [&mut left[frame.clone()], &mut right[frame]],
            );
        }
        ears
    }

    fn degrees_off(place: Option<Vec3>, azimuth: f32) -> f32 {
        let place = place.expect("it is known");
        assert!((place.x.hypot(place.z) - 2.0).abs() < 1e-4 && place.y == 1.5);
        let off = place.x.atan2(place.z) - azimuth;
        (off - TAU * (off / TAU).round()).abs().to_degrees()
    }

    #[test]
    fn a_still_head_tells_the_side_and_a_turning_one_the_direction() {
        let mut mirrored = 0;
        for i in 0..24 {
            let azimuth = PI * i as f32 / 12.0;
            // Behind the ears: as in a mirror.
            let told = if azimuth.cos() < -1e-3 { PI - azimuth } else { azimuth };
            mirrored += u32::from(told != azimuth);
            let still = heads(|_| 0.0);
            let [left, right] = heard(azimuth, &still);
            let places = locate([&left, &right], SAMPLE_RATE, &still).unwrap();
            for place in &places[1..] {
                assert!(degrees_off(*place, told) < 8.0, "{i}: {place:?}");
            }
            // By 40 degrees to either side, within a second.
            for side in [-1.0, 1.0] {
                let turning = heads(|t| side * 0.7 * (t as f32 / 30.0).min(1.0));
                let [left, right] = heard(azimuth, &turning);
                let places = locate([&left, &right], SAMPLE_RATE, &turning).unwrap();
                for place in &places[10..] {
                    assert!(degrees_off(*place, azimuth) < 8.0, "{i}, {side}: {place:?}");
                }
            }
        }
        assert_eq!(mirrored, 11);
    }

    #[test]
    fn nothing_is_known_of_silence_and_of_what_is_long_over() {
        let still = heads(|_| 0.0);
        let quiet = vec![0.0; 4 * SAMPLE_RATE as usize];
        assert!(locate([&quiet, &quiet], SAMPLE_RATE, &still).unwrap().iter().all(Option::is_none));
        let [mut left, mut right] = heard(FRAC_PI_2, &still);
        left[6 * FRAME_SAMPLES..].fill(0.0);
        right[6 * FRAME_SAMPLES..].fill(0.0);
        let places = locate([&left, &right], SAMPLE_RATE, &still).unwrap();
        // A tone of 86 dB fades by 1.5 dB a frame and is known for 2 s more: beyond the clip.
        assert!(places[1..].iter().all(Option::is_some) && places[0].is_some());
    }

    #[test]
    fn a_sound_from_elsewhere_is_followed() {
        let still = heads(|_| 0.0);
        let (first, then) = (heard(0.5, &still), heard(-0.7, &still));
        let middle = BLOCKS / 2 * BLOCK_SAMPLES;
        let ears = [0, 1].map(|side| [&first[side][..middle], &then[side][middle..]].concat());
        let places = locate(ears.each_ref().map(Vec::as_slice), SAMPLE_RATE, &still).unwrap();
        assert!(degrees_off(places[BLOCKS / 2 - 1], 0.5) < 6.0);
        let late = places[BLOCKS / 2..].iter().position(|place| degrees_off(*place, -0.7) < 6.0);
        assert!(late.is_some_and(|blocks| blocks <= 5), "{late:?} blocks later");
        assert!(degrees_off(places[BLOCKS - 1], -0.7) < 6.0);
    }
}
