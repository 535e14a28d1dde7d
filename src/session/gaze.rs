//! From the gaze that is wanted to the value of the gaze channel.
//!
//! A wanted score is turned into the channel's value that brings it about, as the bundle was
//! calibrated ([`GazeConfig`]). Gaze that is left free is not left to the network alone: low noise
//! and guidance draw it to what is most common, which is contact. It gets a level of the
//! calibration's clips instead, another one every now and then, as one condition among others: no
//! third guidance branch.

use crate::config::GazeConfig;
use crate::flow::uniform;
use crate::frame::{BLOCK_FRAMES, FPS, Sampler};

/// What gaze targets, and their absence, mean to a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GazeControl {
    /// Targets are mean gaze scores, and free gaze is drawn from those of recorded conversations,
    /// both as the bundle was calibrated; [`GazeControl::Channel`] in a bundle that was not.
    #[default]
    Calibrated,
    /// Targets are values of the network's gaze channel, and free gaze has none. For measuring, and
    /// for checks of the maths.
    Channel,
    /// As [`GazeControl::Channel`], but targets are not guided towards. For measuring.
    Unguided,
}

/// A value of the gaze channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cue {
    /// The value, -1 to 1.
    pub value: f32,
    /// Whether it is guided towards.
    pub guided: bool,
}

impl GazeControl {
    /// Whether a session's gaze target makes a guidance branch of its own necessary.
    pub(super) fn guides(self, target: Option<f32>) -> bool {
        target.is_some() && self != Self::Unguided
    }

    /// What the channel holds in block `block` of a session with this seed that is made by
    /// `sampler`.
    pub(super) fn cue(
        self,
        config: Option<&GazeConfig>,
        target: Option<f32>,
        sampler: Sampler,
        seed: u64,
        block: u64,
    ) -> Option<Cue> {
        let Some(config) = config.filter(|_| self == Self::Calibrated) else {
            return target.map(|value| Cue { value, guided: self.guides(target) });
        };
        let score = target.unwrap_or_else(|| level(config, seed, block));
        let curve = match (sampler, &config.student) {
            (Sampler::Single, Some(student)) => student,
            _ if target.is_some() => &config.guided,
            _ => &config.unguided,
        };
        Some(Cue { value: curve.channel(score), guided: target.is_some() })
    }
}

/// The number in 0 .. 1 that is drawn for the stretch in which a block lies: stretches of `seconds`
/// on average, whose borders lie anywhere in the first half of their period. A function of the
/// block's number, so that it needs no state and replays.
pub(super) fn drawn(seed: u64, block: u64, seconds: f32) -> f32 {
    let periods = block as f64 * BLOCK_FRAMES as f64 / f64::from(FPS) / f64::from(seconds);
    let period = periods as u64;
    let begun = periods - period as f64 >= 0.5 * f64::from(uniform(seed, period)[0]);
    // The stretch before the first border is one too.
    let stretch = if begun { period + 1 } else { period };
    uniform(seed, stretch)[1]
}

/// The level of free gaze in a block, drawn for each stretch from the calibration's quantiles.
fn level(config: &GazeConfig, seed: u64, block: u64) -> f32 {
    let at = drawn(seed, block, config.seconds) * (config.levels.len() - 1) as f32;
    let below = at as usize;
    let above = (below + 1).min(config.levels.len() - 1);
    config.levels[below] + (at - below as f32) * (config.levels[above] - config.levels[below])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ResponseCurve;

    fn config() -> GazeConfig {
        GazeConfig {
            guided: ResponseCurve(vec![[0.1, -0.4], [0.5, 0.3], [0.9, 0.7]]),
            unguided: ResponseCurve(vec![[0.0, -1.0], [1.0, 1.0]]),
            student: Some(ResponseCurve(vec![[0.2, 0.0], [0.8, 0.5]])),
            levels: vec![-0.2, 0.4, 0.8, 1.0],
            seconds: 20.0,
        }
    }

    #[test]
    fn targets_go_through_the_curve_of_their_sampler() {
        let config = config();
        let value = |target, sampler| GazeControl::Calibrated.cue(Some(&config), Some(target), sampler, 0, 7);
        let near = |cue: Option<Cue>, value: f32| cue.is_some_and(|c| (c.value - value).abs() < 1e-6 && c.guided);
        assert!(near(value(0.3, Sampler::Midpoint4), -0.05), "halfway between two points");
        assert!(near(value(0.5, Sampler::Single), 0.25), "the student has a curve of its own");
        assert!(near(value(-1.0, Sampler::Midpoint4), -0.4) && near(value(1.0, Sampler::Midpoint2), 0.7), "ends");
    }

    #[test]
    fn without_calibration_targets_are_the_channel() {
        let cue = |control: GazeControl, config, target| control.cue(config, target, Sampler::Midpoint4, 0, 0);
        assert_eq!(cue(GazeControl::Calibrated, None, Some(0.3)), Some(Cue { value: 0.3, guided: true }));
        assert_eq!(cue(GazeControl::Calibrated, None, None), None);
        let config = config();
        assert_eq!(cue(GazeControl::Channel, Some(&config), Some(0.3)), Some(Cue { value: 0.3, guided: true }));
        assert_eq!(cue(GazeControl::Channel, Some(&config), None), None);
        assert_eq!(cue(GazeControl::Unguided, Some(&config), Some(0.3)), Some(Cue { value: 0.3, guided: false }));
    }

    #[test]
    fn free_gaze_has_the_levels_of_its_clips_and_changes_now_and_then() {
        let config = config();
        let blocks = 200_000u64;
        let values: Vec<f32> = (0..blocks).map(|b| level(&config, 3, b)).collect();
        let mean = values.iter().sum::<f32>() / blocks as f32;
        // Between evenly spaced quantiles the distribution is linear: the mean of the three pieces.
        assert!((mean - (0.1 + 0.6 + 0.9) / 3.0).abs() < 0.03, "mean level {mean}");
        let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let seconds = blocks as f64 * 4.0 / 30.0 / changes as f64;
        assert!((19.0..21.0).contains(&seconds), "a stretch lasts {seconds} s on average");
        assert_eq!(values[1234], level(&config, 3, 1234));
        assert_ne!(values[1234], level(&config, 4, 1234), "seeds differ");
    }
}
