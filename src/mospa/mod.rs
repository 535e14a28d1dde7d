//! Reactions to sound, a whole clip at a time: MOSPA's model (Xu et al. 2025), run at a desk.
//!
//! ```text
//! sounds -> audio::ears -> audio::features -> denoiser, 1 to 1000 times -> frames
//! ```
//!
//! The network predicts the clean motion (x0); sampling is deterministic, given the noise that it
//! starts from. Mirrors `training/visavis_train/mospa/`. The same bits on every CPU and with one or
//! two threads.
//!
//! | file | what |
//! |---|---|
//! | `pose` | motion vectors to frames |
//! | `schedule` | noise of diffusion steps |
//! | `network` | the denoiser |

mod network;
mod pose;
mod schedule;
#[cfg(test)]
mod tests;

pub use pose::motion_size;

use crate::audio::features::SIZE;
use crate::bundle::{BundleFile, Tensors};
use crate::config::{Config, Kind, MospaConfig};
use crate::error::{Error, ErrorKind, Result};
use crate::flow::normal;
use crate::frame::Frame;
use crate::kernels::Kernels;
use crate::normaliser::{Metric, Standardised};
use network::Network;

/// Sensitivity that is not given; 0 is dull, 1 neutral, 2 sensitive.
const UNKNOWN: usize = 3;
/// Farthest coordinate of a source, metres.
const FARTHEST: f32 = crate::audio::ears::FARTHEST as f32;

/// What the agent hears in a clip.
#[derive(Debug, Clone, Copy)]
pub struct Heard<'a> {
    /// Features of the left ear, `[T, 132]`.
    pub left: &'a [f32],
    /// Those of the right ear.
    pub right: &'a [f32],
    /// Where the sound comes from, metres in the agent's frame at frame 0 (+X left, Y up from the
    /// floor, +Z ahead); none: unknown.
    pub place: Option<[f32; 3]>,
    /// Sensitivity: 0 dull, 1 neutral, 2 sensitive; none: not given.
    pub genre: Option<u8>,
}

/// A loaded bundle of the kind `mospa`.
#[derive(Debug)]
pub struct Reactor {
    config: Config,
    sizes: MospaConfig,
    kernels: Kernels,
    network: Network,
}

impl Reactor {
    /// Loads `file` for `kernels`.
    ///
    /// # Errors
    /// Those of [`BundleFile::parse`]; [`ErrorKind::BundleInvalid`] or
    /// [`ErrorKind::BundleCorrupt`] for a tensor that is missing, of another shape or not finite;
    /// [`ErrorKind::Argument`] for a bundle of another kind. All name the file.
    pub fn load(file: &BundleFile<'_>, kernels: Kernels) -> Result<Self> {
        let (config, tensors) = file.parse()?;
        Self::from_tensors(config, &tensors, kernels).map_err(|e| e.with_path(file.path()))
    }

    /// Of given tensors.
    ///
    /// # Errors
    /// As [`Reactor::load`], without a file.
    pub fn from_tensors(config: Config, t: &Tensors<'_>, kernels: Kernels) -> Result<Self> {
        let (Kind::Mospa, Some(sizes)) = (config.kind, config.mospa) else {
            let kind = config.kind.name();
            let message =
                format!("a bundle of the kind `{kind}` does not react to clips; this needs one of the kind `mospa`");
            return Err(Error::new(ErrorKind::Argument, message));
        };
        let network = Network::load(t, kernels, &sizes, config.rig.len())?;
        t.finish()?;
        Ok(Self { config, sizes, kernels, network })
    }

    /// The bundle's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Frames of a clip, T.
    pub fn frames(&self) -> usize {
        self.sizes.frames
    }

    /// Steps of sampling where nobody says otherwise.
    pub fn steps(&self) -> usize {
        self.sizes.steps
    }

    /// Bytes of the packed weights.
    pub fn bytes(&self) -> usize {
        self.network.bytes()
    }

    /// Noise to start from, `[T, 12 J]`: a function of `seed`.
    pub fn noise(&self, seed: u64) -> Vec<f32> {
        let mut noise = vec![0.0; self.network.size()];
        let width = motion_size(self.config.rig.len());
        for (t, row) in noise.chunks_exact_mut(width).enumerate() {
            normal(seed, t as u64, row);
        }
        noise
    }

    /// The motion `[T, 12 J]`, metres, that `steps` steps make of `noise` `[T, 12 J]` and what was
    /// heard, on `threads` threads.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for another number of steps than 1 to the bundle's diffusion steps,
    /// features or noise of another length, numbers that are none, a sensitivity above 2, threads
    /// other than 1 or 2.
    pub fn motion(&self, heard: &Heard<'_>, noise: &[f32], steps: usize, threads: usize) -> Result<Vec<f32>> {
        self.check(heard, noise, steps)?;
        let mut work = self.network.work(self.kernels, threads, heard)?;
        let (mut x, mut clean) = (noise.to_vec(), vec![0.0; noise.len()]);
        for step in schedule::sampling(self.sizes.diffusion_steps, steps) {
            self.network.clean(&mut work, &x, step.time, &mut clean);
            for (x, clean) in x.iter_mut().zip(&clean) {
                let away = (*x - step.now[0] * clean) / step.now[1];
                *x = step.then[0] * clean + step.then[1] * away;
            }
        }
        let mut out = Metric::zeros(x.len());
        self.network.motion.restore(Standardised::new(x.as_slice()), out.view_mut());
        Ok(out.values().to_vec())
    }

    /// One evaluation: the clean motion, standardised, of `noise` at diffusion step `time`.
    ///
    /// # Errors
    /// As [`Reactor::motion`].
    pub fn clean(&self, heard: &Heard<'_>, noise: &[f32], time: usize) -> Result<Vec<f32>> {
        self.check(heard, noise, time + 1)?;
        let mut out = vec![0.0; noise.len()];
        self.network.clean(&mut self.network.work(self.kernels, 1, heard)?, noise, time, &mut out);
        Ok(out)
    }

    /// Frames of `motion`.
    ///
    /// # Errors
    /// [`ErrorKind::State`] where numbers are none.
    pub fn poses(&self, motion: &[f32]) -> Result<Vec<Frame>> {
        let width = motion_size(self.config.rig.len());
        let mut way = [0.0; 2];
        let frame = |(i, x)| pose::frame(&self.config.rig, i, x, &mut way);
        motion.chunks_exact(width).enumerate().map(frame).collect()
    }

    fn check(&self, heard: &Heard<'_>, noise: &[f32], steps: usize) -> Result<()> {
        let argument = |message: String| Err(Error::new(ErrorKind::Argument, message));
        if !(1..=self.sizes.diffusion_steps).contains(&steps) {
            return argument(format!("{steps} diffusion steps: this bundle takes 1 to {}", self.sizes.diffusion_steps));
        }
        let (frames, size) = (self.sizes.frames, self.network.size());
        for (what, values, wanted) in [
            ("left features", heard.left, frames * SIZE),
            ("right features", heard.right, frames * SIZE),
            ("noise", noise, size),
        ] {
            if values.len() != wanted {
                return argument(format!("{} numbers of {what}: a clip of {frames} frames has {wanted}", values.len()));
            }
            if !values.iter().all(|v| v.is_finite()) {
                return argument(format!("the {what} are not all numbers"));
            }
        }
        if heard.place.is_some_and(|place| !place.iter().all(|v| v.abs() <= FARTHEST)) {
            return argument(format!("the source at {:?} is not within {FARTHEST} m", heard.place.unwrap_or_default()));
        }
        match heard.genre {
            Some(genre) if usize::from(genre) >= UNKNOWN => {
                argument(format!("sensitivity {genre}: 0 is dull, 1 neutral, 2 sensitive"))
            }
            _ => Ok(()),
        }
    }
}
