//! What the gaze channel does to a model's gaze, measured on clips.

use super::EvalProgress;
use super::clip::Clip;
use super::motion;
use super::parallel::each;
use super::window::{WINDOW, Window};
use crate::metrics::head_angle;
use std::sync::Arc;
use visavis::internals::config::{GazeConfig, ResponseCurve};
use visavis::internals::session::{Diagnostics, GazeControl};
use visavis::{Engine, Error, ErrorKind, FPS, Result, Sampler, SessionOptions};

/// Values of the channel at which the model's gaze is measured.
const CHANNEL: [f32; 7] = [-0.6, -0.3, 0.0, 0.25, 0.5, 0.75, 1.0];
/// Evenly spaced quantiles of the clips' gaze that are kept.
const LEVELS: usize = 17;

/// Measures a model's gaze as a function of its gaze channel, on at most `windows` windows of
/// `clips` and `threads` threads, and the gaze of the clips' own agents on all their windows (of
/// conversations it takes a hundred to tell their mean within 0.03). Best on clips that were not
/// trained on; the figures of `visavis eval` are then taken on others again.
///
/// The result is for the bundle's default guidance; it goes into the bundle's config
/// ([`visavis::internals::config::Config::gaze`]), and sessions follow it unless told otherwise
/// ([`GazeControl`]). What the config holds so far makes no difference.
///
/// # Errors
/// Those of [`Clip::read`], [`Window::choose`] and of sessions; [`ErrorKind::Argument`] for clips
/// without users, and for a model whose gaze does not follow its channel.
pub fn calibrate(
    engine: &Arc<Engine>,
    clips: &[Clip],
    windows: usize,
    threads: usize,
    progress: &(dyn Fn(EvalProgress<'_>) + Sync),
) -> Result<GazeConfig> {
    let windows = Window::choose(clips, windows)?;
    let rig = &engine.config().rig;
    let mut levels = Vec::new();
    for window in Window::every(clips) {
        let truth = window?.truth;
        levels.extend(head_angle(&truth.recording(rig, truth.frames.clone())).map(|level| level as f32));
    }
    if levels.is_empty() {
        return Err(Error::new(ErrorKind::Argument, "no window of the clips has a user to look at"));
    }
    levels.sort_by(f32::total_cmp);

    let curve = |name: &str, sampler: Sampler, gaze_control: GazeControl| {
        let mut points = Vec::new();
        for value in CHANNEL {
            let stage = format!("{name}, channel at {value}");
            let done = |done| progress(EvalProgress { stage: &stage, done, total: windows.len() });
            let scores = each(threads, windows.len(), &done, &|i| {
                let seed = i as u64;
                let diagnostics = Diagnostics { gaze_control, ..Default::default() };
                let options = SessionOptions { sampler, gaze: Some(value), diagnostics, seed, ..Default::default() };
                let frames = motion::in_window(engine, &options, &windows[i])?;
                Ok(head_angle(&windows[i].truth.recording(rig, frames)))
            })?;
            let scores: Vec<f64> = scores.into_iter().flatten().collect();
            if !scores.is_empty() {
                points.push([(scores.iter().sum::<f64>() / scores.len() as f64) as f32, value]);
            }
        }
        ascending(&points, name)
    };
    let reference = SessionOptions::default().sampler;
    Ok(GazeConfig {
        guided: curve("guided", reference, GazeControl::Channel)?,
        unguided: curve("unguided", reference, GazeControl::Unguided)?,
        student: match engine.config().student {
            Some(_) => Some(curve("student", Sampler::Single, GazeControl::Channel)?),
            None => None,
        },
        levels: quantiles(&levels),
        seconds: WINDOW as f32 / FPS as f32,
    })
}

/// Quantiles from the least to the largest of sorted `values`, which are some.
fn quantiles(values: &[f32]) -> Vec<f32> {
    let last = values.len() - 1;
    let quantile = |i: usize| {
        let at = (i * last) as f32 / (LEVELS - 1) as f32;
        let below = at as usize;
        let above = values[(below + 1).min(last)];
        values[below] + (at - below as f32) * (above - values[below])
    };
    (0..LEVELS).map(quantile).collect()
}

/// A curve that ascends, from points by ascending channel value: neighbours that do not ascend are
/// pooled (isotonic regression by pool adjacent violators, Ayer et al. 1955), and a pool enters as
/// one point.
pub(super) fn ascending(points: &[[f32; 2]], name: &str) -> Result<ResponseCurve> {
    let mut pools: Vec<([f32; 2], f32)> = Vec::new();
    for point in points {
        let (mut pool, mut size) = (*point, 1.0);
        while let Some((before, n)) = pools.pop_if(|(before, _)| before[0] >= pool[0] - 1e-4) {
            pool = std::array::from_fn(|i| (before[i] * n + pool[i] * size) / (n + size));
            size += n;
        }
        pools.push((pool, size));
    }
    if pools.len() < 2 {
        let message = format!("{name}: this model does not follow the channel, so it cannot be calibrated");
        return Err(Error::new(ErrorKind::Argument, message));
    }
    Ok(ResponseCurve(pools.into_iter().map(|(point, _)| point).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_do_not_ascend_are_pooled() {
        let curve = ascending(&[[0.1, -1.0], [0.5, -0.5], [0.3, 0.0], [0.8, 0.5], [0.8, 1.0]], "x").unwrap();
        assert_eq!(curve.0, [[0.1, -1.0], [0.4, -0.25], [0.8, 0.75]]);
        assert!(ascending(&[[0.5, 0.0], [0.5, 1.0]], "x").is_err());
    }

    #[test]
    fn quantiles_are_evenly_spaced() {
        let all = quantiles(&[0.0, 1.0]);
        assert_eq!((all.len(), all[0], all[LEVELS / 2], all[LEVELS - 1]), (LEVELS, 0.0, 0.5, 1.0));
        assert_eq!(quantiles(&[0.3])[..2], [0.3, 0.3]);
    }
}
