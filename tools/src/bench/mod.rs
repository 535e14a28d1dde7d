//! How fast a bundle runs here, and where the time goes.
//!
//! ```text
//! Engine (a bundle, or seeded weights of a size) -> blocks of a synthetic conversation -> block times, stages, bytes, memory -> Bench
//! ```
//!
//! Speed does not depend on what weights hold, so sizes for which there is no trained bundle are
//! measured with seeded ones ([`Size::engine`]). What a machine's memory gives is measured in the
//! same run, because the time of a block is mostly that of reading weights.

mod load;
mod machine;
mod sizes;
mod sounds;
mod stages;

pub use load::{LoadOptions, Times, UnderLoad};
pub use machine::{Machine, memory, read_limit};
pub use sizes::Size;
pub use sounds::{SoundOptions, WithSounds};
pub use stages::{STAGES, StageTimes};

use crate::contents::made_with;
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use visavis::internals::frame::BLOCK_SAMPLES;
use visavis::{
    BLOCK_FRAMES, Engine, Error, ErrorKind, FPS, Result, SAMPLE_RATE, Sampler, Session, SessionOptions, Team,
};

/// Blocks before any is timed: caches fill, pages are touched, clocks go up.
const WARM_UP: usize = 16;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct BenchOptions {
    /// Sampler.
    pub sampler: Sampler,
    /// Threads that compute, 1 or 2.
    pub threads: usize,
    /// Sessions that are stepped together ([`Team`]); one is polled by itself.
    pub sessions: usize,
    /// Blocks that are timed.
    pub blocks: usize,
    /// Seconds of sound that each session's voices have room for.
    pub voice_ahead: f64,
    /// Counts the allocations of this process so far, where the program can: those of the timed
    /// blocks are reported.
    pub allocations: Option<fn() -> u64>,
}

impl Default for BenchOptions {
    fn default() -> Self {
        let voice_ahead = SessionOptions::default().voice_ahead;
        Self { sampler: Sampler::Midpoint4, threads: 1, sessions: 1, blocks: 200, voice_ahead, allocations: None }
    }
}

/// What was measured. Times are milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bench {
    /// Name of the model.
    pub model: String,
    /// Sampler; the kind of bundles without any.
    pub sampler: String,
    /// Threads.
    pub threads: usize,
    /// Sessions, stepped together where there are several.
    pub sessions: usize,
    /// Blocks of each session that were timed.
    pub blocks: usize,
    /// Time of a block, of all sessions together: median, 95th and 99th percentile, longest.
    pub block_ms: [f64; 4],
    /// Mean times of the stages of a block, of as many further blocks; `None` with several
    /// sessions.
    pub stages: Option<StageTimes>,
    /// Frames a second at the median, of all sessions together.
    pub frames_per_second: f64,
    /// Seconds of motion a second at the median, of each session.
    pub real_time_factor: f64,
    /// Blocks of sessions that shared passes over the weights with another session's, a block of
    /// all.
    pub shared_blocks: f64,
    /// Bytes of packed weights that a block of one session reads.
    pub weight_bytes_a_block: usize,
    /// The same a second at the median, GB/s; of several sessions as if each read its own.
    pub weights_gb_s: f64,
    /// What a plain reading loop gets from memory with as many threads, GB/s: median of several.
    pub read_limit_gb_s: f64,
    /// Share of that which one session's weights take.
    pub share_of_read_limit: f64,
    /// Allocations and releases while the timed blocks were computed, where they were counted.
    pub steady_allocations: Option<u64>,
    /// From the making of the sessions to their first frames.
    pub first_frame_ms: f64,
    /// Bytes of all packed weights.
    pub weight_bytes: usize,
    /// Bytes of the sessions' caches; of the kind `dram`, of what its predictors remember.
    pub cache_bytes: usize,
    /// The same of one session.
    pub state_bytes_a_session: usize,
    /// Memory of this process that is resident after the timed blocks, bytes, where the system
    /// tells.
    pub resident_bytes: Option<u64>,
    /// The most that was, from the making of the sessions on (where the system does not let the
    /// peak be reset: of the process).
    pub peak_resident_bytes: Option<u64>,
}

impl Bench {
    /// Measures `engine`; takes as long as twice the blocks do, and about a second for memory.
    ///
    /// # Errors
    /// Those of making a session; [`ErrorKind::Argument`] for no blocks or no sessions.
    pub fn run(engine: &Arc<Engine>, options: BenchOptions) -> Result<Self> {
        let BenchOptions { sampler, threads, sessions, blocks, allocations, .. } = options;
        if blocks == 0 || sessions == 0 {
            return Err(Error::new(ErrorKind::Argument, "nothing to measure: at least one block of one session"));
        }
        machine::reset_peak();
        let started = Instant::now();
        let mut talks = Talks::new(engine, &options)?;
        talks.block(None)?;
        let first_frame_ms = ms(started.elapsed());
        for _ in 0..WARM_UP {
            talks.block(None)?;
        }
        let mut times = Vec::with_capacity(blocks);
        let mut calls = 0;
        let shared = talks.shared_blocks();
        for _ in 0..blocks {
            talks.hear()?;
            let (time, made) = talks.compute(None, allocations.unwrap_or(|| 0))?;
            times.push(time);
            calls += made;
        }
        let shared = talks.shared_blocks() - shared;
        let (resident_bytes, peak_resident_bytes) = (machine::resident(), machine::peak_resident());
        let mut stages = StageTimes::default();
        if sessions == 1 {
            for _ in 0..blocks {
                talks.block(Some(&mut stages))?;
            }
        }
        times.sort();
        let at = |share: f64| ms(times[((share * blocks as f64).ceil() as usize).clamp(1, blocks) - 1]);
        let median = at(0.5);
        let bytes = engine.block_bytes(sampler);
        let (rate, limit) = (bytes as f64 / median / 1e6, read_limit(threads));
        Ok(Self {
            model: engine.config().name.clone(),
            sampler: made_with(engine, sampler),
            threads,
            sessions,
            blocks,
            block_ms: [median, at(0.95), at(0.99), at(1.0)],
            stages: (sessions == 1).then(|| stages.mean(blocks)),
            frames_per_second: 1000.0 * (sessions * BLOCK_FRAMES) as f64 / median,
            real_time_factor: 1000.0 * BLOCK_FRAMES as f64 / f64::from(FPS) / median,
            shared_blocks: shared as f64 / blocks as f64,
            weight_bytes_a_block: bytes,
            weights_gb_s: rate * sessions as f64,
            read_limit_gb_s: limit,
            share_of_read_limit: rate / limit,
            steady_allocations: allocations.map(|_| calls),
            first_frame_ms,
            weight_bytes: engine.weight_bytes(),
            cache_bytes: talks.cache_bytes(),
            state_bytes_a_session: talks.cache_bytes() / sessions,
            resident_bytes,
            peak_resident_bytes,
        })
    }
}

/// Sessions in a synthetic conversation each: two voices, a user who circles.
struct Talks {
    sessions: Vec<Session>,
    team: Option<Team>,
    samples: Vec<f32>,
}

impl Talks {
    fn new(engine: &Arc<Engine>, options: &BenchOptions) -> Result<Self> {
        let BenchOptions { sampler, threads, sessions, voice_ahead, .. } = *options;
        let tone = |i: usize| {
            let t = i as f32 / SAMPLE_RATE as f32;
            0.2 * (900.0 * t).sin() * (23.0 * t).sin().max(0.0)
        };
        let team = (sessions > 1).then(|| engine.team(threads)).transpose()?;
        // A team has the threads.
        let threads = if team.is_some() { 1 } else { threads };
        let options = |seed| SessionOptions { sampler, threads, seed, voice_ahead, ..SessionOptions::default() };
        let session = |seed| engine.session(options(seed as u64));
        let sessions = (0..sessions).map(session).collect::<Result<_>>()?;
        Ok(Self { sessions, team, samples: (0..BLOCK_SAMPLES).map(tone).collect() })
    }

    /// Pushes what the next block hears and sees.
    fn hear(&mut self) -> Result<()> {
        for session in &mut self.sessions {
            let now = session.next_due();
            session.push_agent_audio(&self.samples, SAMPLE_RATE)?;
            session.push_user_audio(&self.samples, SAMPLE_RATE)?;
            let angle = 0.4 * now as f32;
            session.push_user_head(Vec3::new(1.5 * angle.sin(), 1.65, 1.5 * angle.cos()), now)?;
        }
        Ok(())
    }

    /// Computes the next block of all; the time that it took, and by how much `count` went up. Only
    /// a session by itself has a probe.
    fn compute(&mut self, probe: Option<&mut StageTimes>, count: fn() -> u64) -> Result<(Duration, u64)> {
        if let Some(team) = &mut self.team {
            let mut due: Vec<_> = (self.sessions.iter_mut())
                .map(|session| {
                    let now = session.next_due();
                    (session, now)
                })
                .collect();
            let (before, started) = (count(), Instant::now());
            team.step(&mut due)?;
            return Ok((started.elapsed(), count() - before));
        }
        let session = &mut self.sessions[0];
        let now = session.next_due();
        let (before, started) = (count(), Instant::now());
        match probe {
            None => session.poll(now)?,
            Some(stages) => {
                stages.start();
                session.poll_with(now, Some(stages))?
            }
        };
        Ok((started.elapsed(), count() - before))
    }

    fn block(&mut self, probe: Option<&mut StageTimes>) -> Result<()> {
        self.hear()?;
        self.compute(probe, || 0).map(drop)
    }

    fn shared_blocks(&self) -> u64 {
        self.team.as_ref().map_or(0, Team::shared_blocks)
    }

    fn cache_bytes(&self) -> usize {
        self.sessions.iter().map(|session| session.stats().cache_bytes).sum()
    }
}

fn ms(time: Duration) -> f64 {
    1000.0 * time.as_secs_f64()
}

#[cfg(test)]
mod tests;
