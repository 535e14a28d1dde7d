//! The noise of diffusion steps, and which of them sampling visits.
//!
//! Cosine schedule (Nichol and Dhariwal 2021), sampled without noise of its own (Song et al. 2021,
//! eta 0): the motion is a function of the noise that it starts from.

use std::f64::consts::FRAC_PI_2;

/// A step of sampling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    /// The diffusion step that the network is told.
    pub(super) time: usize,
    /// Amplitudes of motion and of noise there.
    pub(super) now: [f32; 2],
    /// Those of the next step.
    pub(super) then: [f32; 2],
}

/// Share of the motion's power that is left after each of `steps` steps of diffusion.
fn kept(steps: usize) -> Vec<f64> {
    let f = |i: usize| {
        let c = libm::cos((i as f64 / steps as f64 + 0.008) / 1.008 * FRAC_PI_2);
        c * c
    };
    let mut product = 1.0;
    let next = |i: usize| {
        product *= 1.0 - (1.0 - f(i + 1) / f(i)).min(0.999);
        product
    };
    (0..steps).map(next).collect()
}

/// The `count` steps that sampling takes of a diffusion of `steps`, in their order.
pub(super) fn sampling(steps: usize, count: usize) -> Vec<Step> {
    let kept = kept(steps);
    let time = |i: usize| (i + 1) * steps / count - 1;
    let amplitudes = |time: usize| [kept[time].sqrt() as f32, (1.0 - kept[time]).sqrt() as f32];
    let step = |i: usize| Step {
        time: time(i),
        now: amplitudes(time(i)),
        then: if i == 0 { [1.0, 0.0] } else { amplitudes(time(i - 1)) },
    };
    (0..count).rev().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_from_noise_to_motion() {
        for count in [1, 4, 100, 999, 1000] {
            let steps = sampling(1000, count);
            assert_eq!((steps.len(), steps[0].time), (count, 999));
            assert!(steps[0].now[1] > 0.999 && steps[count - 1].then == [1.0, 0.0]);
            for pair in steps.windows(2) {
                assert!(pair[1].time < pair[0].time && pair[0].then == pair[1].now);
            }
        }
        let times: Vec<_> = sampling(1000, 4).iter().map(|s| s.time).collect();
        assert_eq!(times, [999, 749, 499, 249]);
        assert_eq!(sampling(1000, 1000)[999].time, 0);
    }
}
