//! Blocks beside other work that wants the cores: with one and with two threads, in turns.

use super::{BenchOptions, Talks, WARM_UP, ms};
use crate::contents::made_with;
use serde::Serialize;
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use visavis::{Engine, Error, ErrorKind, Result, Sampler};

/// Blocks of a turn. Other work comes and goes, and should meet both.
const TURN: usize = 20;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct LoadOptions {
    /// Sampler.
    pub sampler: Sampler,
    /// Threads of other work, each of which does nothing but compute.
    pub load: usize,
    /// From the start of one block to the start of the next, at least; zero: one after the other.
    pub every: Duration,
    /// Blocks that are timed with each number of threads.
    pub blocks: usize,
}

/// Times of blocks, milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Times {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Longest.
    pub max: f64,
}

impl Times {
    /// Of at least one block.
    pub(super) fn of(times: &mut [Duration]) -> Self {
        times.sort();
        let at = |share: f64| ms(times[((share * times.len() as f64).ceil() as usize).clamp(1, times.len()) - 1]);
        let mean = times.iter().map(|time| ms(*time)).sum::<f64>() / times.len() as f64;
        Self { mean, p50: at(0.5), p95: at(0.95), p99: at(0.99), max: at(1.0) }
    }

    /// Each figure as it is called.
    pub fn named(&self) -> [(&'static str, f64); 5] {
        [("mean", self.mean), ("p50", self.p50), ("p95", self.p95), ("p99", self.p99), ("max", self.max)]
    }
}

/// What was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnderLoad {
    /// Sampler.
    pub sampler: String,
    /// Busy threads.
    pub load: usize,
    /// Milliseconds from one block's start to the next's, at least.
    pub every_ms: f64,
    /// Blocks with each number of threads.
    pub blocks: usize,
    /// Times of a block with one thread and with two.
    pub block_ms: [Times; 2],
}

impl UnderLoad {
    /// Measures `engine`: a session with one thread and one with two, 20 blocks each in turns,
    /// beside busy threads.
    ///
    /// # Errors
    /// Those of making a session; [`ErrorKind::Argument`] for no blocks.
    pub fn run(engine: &Arc<Engine>, options: LoadOptions) -> Result<Self> {
        let LoadOptions { sampler, load, every, blocks } = options;
        if blocks == 0 {
            return Err(Error::new(ErrorKind::Argument, "nothing to measure: at least one block"));
        }
        let talks = |threads| Talks::new(engine, &BenchOptions { sampler, threads, ..BenchOptions::default() });
        let mut talks = [talks(1)?, talks(2)?];
        for talks in &mut talks {
            (0..WARM_UP).try_for_each(|_| talks.block(None))?;
        }
        let mut times = [Vec::with_capacity(blocks), Vec::with_capacity(blocks)];
        let stop = AtomicBool::new(false);
        thread::scope(|scope| {
            for _ in 0..load {
                scope.spawn(|| busy(&stop));
            }
            let measured = measure(&mut talks, &mut times, blocks, every);
            stop.store(true, Ordering::Relaxed);
            measured
        })?;
        let block_ms = times.map(|mut times| Times::of(&mut times));
        Ok(Self { sampler: made_with(engine, sampler), load, every_ms: ms(every), blocks, block_ms })
    }
}

fn measure(talks: &mut [Talks; 2], times: &mut [Vec<Duration>; 2], blocks: usize, every: Duration) -> Result<()> {
    while times[0].len() < blocks {
        for (talks, times) in talks.iter_mut().zip(&mut *times) {
            for _ in 0..TURN.min(blocks - times.len()) {
                talks.hear()?;
                let (time, _) = talks.compute(None, || 0)?;
                times.push(time);
                thread::sleep(every.saturating_sub(time));
            }
        }
    }
    Ok(())
}

/// Computes until it is told to stop.
fn busy(stop: &AtomicBool) {
    let mut x = 1u64;
    while !stop.load(Ordering::Relaxed) {
        for _ in 0..1000 {
            x = black_box(x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
        }
    }
}
