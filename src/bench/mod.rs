//! How fast a bundle runs here, and where the time goes.
//!
//! ```text
//! Engine (a bundle, or seeded weights of a size) -> blocks of a made-up conversation -> block times, stages, bytes, memory -> Bench
//! ```
//!
//! Speed does not depend on what weights hold, so sizes for which there is no trained bundle are measured with seeded ones
//! ([`Size::engine`]). What a machine's memory gives is measured in the same run, because the time of a block is mostly that of reading weights.

mod machine;
mod sizes;
mod stages;

pub use machine::{Machine, read_limit};
pub use sizes::Size;
pub use stages::{STAGES, StageTimes};

use crate::engine::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FPS, SAMPLE_RATE, Sampler};
use crate::session::{Session, SessionOptions};
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Blocks before any is timed: caches fill, pages are touched, clocks go up.
const WARM_UP: usize = 16;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct BenchOptions {
    /// Sampler.
    pub sampler: Sampler,
    /// Threads of the session, 1 or 2.
    pub threads: usize,
    /// Blocks that are timed.
    pub blocks: usize,
}

/// What was measured. Times are milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bench {
    /// Name of the model.
    pub model: String,
    /// Sampler.
    pub sampler: String,
    /// Threads.
    pub threads: usize,
    /// Blocks that were timed.
    pub blocks: usize,
    /// Time of a block: median, 95th and 99th percentile, longest.
    pub block_ms: [f64; 4],
    /// Mean times of the stages of a block, of as many further blocks.
    pub stages: StageTimes,
    /// Frames a second at the median.
    pub frames_per_second: f64,
    /// Seconds of motion a second at the median.
    pub real_time_factor: f64,
    /// Bytes of packed weights that a block reads.
    pub weight_bytes_a_block: usize,
    /// The same a second at the median, GB/s.
    pub weights_gb_s: f64,
    /// What a plain reading loop gets from memory with as many threads, GB/s: median of several.
    pub read_limit_gb_s: f64,
    /// From the session's making to its first frame.
    pub first_frame_ms: f64,
    /// Bytes of all packed weights.
    pub weight_bytes: usize,
    /// Bytes of the session's caches.
    pub cache_bytes: usize,
    /// Most memory that this process has had resident so far, bytes, where the system tells.
    pub peak_resident_bytes: Option<u64>,
}

impl Bench {
    /// Measures `engine`; takes as long as twice the blocks do, and about a second for memory.
    ///
    /// # Errors
    /// Those of making a session; [`ErrorKind::Argument`] for no blocks.
    pub fn run(engine: &Arc<Engine>, options: BenchOptions) -> Result<Self> {
        let BenchOptions { sampler, threads, blocks } = options;
        if blocks == 0 {
            return Err(Error::new(ErrorKind::Argument, "no blocks to measure"));
        }
        let started = Instant::now();
        let mut talk = Talk::new(engine.session(SessionOptions { sampler, threads, ..SessionOptions::default() })?)?;
        talk.block(None)?;
        let first_frame_ms = ms(started.elapsed());
        for _ in 0..WARM_UP {
            talk.block(None)?;
        }
        let mut times = (0..blocks).map(|_| talk.block(None)).collect::<Result<Vec<_>>>()?;
        let mut stages = StageTimes::default();
        for _ in 0..blocks {
            talk.block(Some(&mut stages))?;
        }
        times.sort();
        let at = |share: f64| ms(times[((share * blocks as f64).ceil() as usize).clamp(1, blocks) - 1]);
        let median = at(0.5);
        let bytes = engine.block_bytes(sampler);
        Ok(Self {
            model: engine.config().name.clone(),
            sampler: sampler.to_string(),
            threads,
            blocks,
            block_ms: [median, at(0.95), at(0.99), at(1.0)],
            stages: stages.mean(blocks),
            frames_per_second: 1000.0 * BLOCK_FRAMES as f64 / median,
            real_time_factor: 1000.0 * BLOCK_FRAMES as f64 / f64::from(FPS) / median,
            weight_bytes_a_block: bytes,
            weights_gb_s: bytes as f64 / median / 1e6,
            read_limit_gb_s: read_limit(threads),
            first_frame_ms,
            weight_bytes: engine.weight_bytes(),
            cache_bytes: talk.session.stats().cache_bytes,
            peak_resident_bytes: machine::peak_resident(),
        })
    }
}

/// A session in a made-up conversation: two voices, a user who circles.
struct Talk {
    session: Session,
    samples: Vec<f32>,
}

impl Talk {
    fn new(session: Session) -> Result<Self> {
        let tone = |i: usize| {
            let t = i as f32 / SAMPLE_RATE as f32;
            0.2 * (900.0 * t).sin() * (23.0 * t).sin().max(0.0)
        };
        Ok(Self { session, samples: (0..BLOCK_SAMPLES).map(tone).collect() })
    }

    /// One block; the time that computing it took, without pushing.
    fn block(&mut self, probe: Option<&mut StageTimes>) -> Result<Duration> {
        let now = self.session.next_due();
        self.session.push_agent_audio(&self.samples, SAMPLE_RATE)?;
        self.session.push_user_audio(&self.samples, SAMPLE_RATE)?;
        let angle = 0.4 * now as f32;
        self.session.push_user_head(Vec3::new(1.5 * angle.sin(), 1.65, 1.5 * angle.cos()), now)?;
        let started = Instant::now();
        match probe {
            None => self.session.poll(now)?,
            Some(stages) => {
                stages.start();
                self.session.poll_with(now, Some(stages))?
            }
        };
        Ok(started.elapsed())
    }
}

fn ms(time: Duration) -> f64 {
    1000.0 * time.as_secs_f64()
}

#[cfg(test)]
mod tests;
