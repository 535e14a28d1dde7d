//! What an evaluation is asked for.

use std::path::PathBuf;
use visavis::{Sampler, SessionOptions};

/// What is evaluated, and how thoroughly.
#[derive(Debug, Clone)]
pub struct EvalOptions {
    /// Most windows, spread evenly over the clips.
    pub windows: usize,
    /// Threads that work on different windows.
    pub threads: usize,
    /// Samplers to compare; the first is the reference. Those that need a student are left out of a
    /// bundle without one.
    pub samplers: Vec<Sampler>,
    /// Options of every session; seed, start, sampler and gaze are set by the evaluation.
    pub session: SessionOptions,
    /// Fewer and shorter runs, for a look: the gaze dial, reaction, endurance and following are
    /// tried a few times only.
    pub quick: bool,
    /// Only what two bundles are compared by: the rows of the corpus, of the autoencoder, of the
    /// samplers with free gaze and of motion made elsewhere, and reconstruction. No looked-up
    /// motion, gaze dials, reaction, endurance and following.
    pub motion_only: bool,
    /// Window `i` has the seed `2^32 seed + i`: with another seed here the figures tell what chance
    /// alone changes.
    pub seed: u32,
    /// Rows of motion made elsewhere: name and folder, which holds a clip of [`super::WINDOW`] frames for
    /// each window, `000.safetensors` and on, in the space of the window's clip. Joints that do
    /// not stand on the rig go through the runtime's fit.
    pub rows: Vec<(String, PathBuf)>,
    /// A new or empty folder for the motion of each row but those with gaze targets, such files.
    pub keep: Option<PathBuf>,
}

impl Default for EvalOptions {
    /// 64 windows on two threads, all samplers of the reference and the single step.
    fn default() -> Self {
        Self {
            windows: 64,
            threads: 2,
            samplers: vec![Sampler::Midpoint4, Sampler::Midpoint2, Sampler::Midpoint1, Sampler::Single],
            session: SessionOptions::default(),
            quick: false,
            motion_only: false,
            seed: 0,
            rows: Vec::new(),
            keep: None,
        }
    }
}
