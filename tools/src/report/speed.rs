//! Time, bytes and memory of each bundle, measured in turns in one run.

use super::numerics::Loaded;
use crate::contents::made_with;
use serde::Serialize;
use std::time::Instant;
use visavis::internals::frame::BLOCK_SAMPLES;
use visavis::{Result, SAMPLE_RATE, Sampler, SessionOptions};

/// Costs of one bundle.
#[derive(Debug, Clone, Serialize)]
pub struct Speed {
    /// What ran.
    pub name: String,
    /// Bytes of the file.
    pub file_bytes: usize,
    /// Bytes of its weights packed for this CPU.
    pub weight_bytes: usize,
    /// Bytes of a session's key-value caches.
    pub cache_bytes: usize,
    /// For each sampler (of bundles without any, their kind): its name, bytes of weights that a
    /// block reads, median milliseconds of a block, and that over the reference's.
    pub samplers: Vec<(String, usize, f64, f64)>,
}

/// Times `blocks` blocks of each bundle and sampler, one block of each in turn, so that what else
/// the machine does strikes all alike.
pub(super) fn measure(loaded: &[&Loaded], blocks: usize, progress: &dyn Fn(&str)) -> Result<Vec<Speed>> {
    let mut speeds: Vec<_> = (loaded.iter())
        .map(|l| Speed {
            name: l.name.clone(),
            file_bytes: l.file.len(),
            weight_bytes: l.engine.weight_bytes(),
            cache_bytes: 0,
            samplers: Vec::new(),
        })
        .collect();
    let student = loaded.iter().all(|l| l.engine.config().student.is_some());
    let samplers = [Some(Sampler::Midpoint4), student.then_some(Sampler::Single)];
    for sampler in samplers.into_iter().flatten() {
        let label = made_with(&loaded[0].engine, sampler);
        progress(&format!("speed in turns, {label}"));
        let options = || SessionOptions { sampler, ..SessionOptions::default() };
        let mut sessions = loaded.iter().map(|l| l.engine.session(options())).collect::<Result<Vec<_>>>()?;
        let mut times = vec![Vec::with_capacity(blocks); sessions.len()];
        let voice: Vec<f32> = (0..BLOCK_SAMPLES).map(|i| 0.1 * libm::sinf(i as f32 * 0.05)).collect();
        for _ in 0..blocks {
            for (session, times) in sessions.iter_mut().zip(&mut times) {
                let now = session.next_due();
                session.push_agent_audio(&voice, SAMPLE_RATE)?;
                session.push_user_audio(&voice, SAMPLE_RATE)?;
                session.push_user_head(glam::Vec3::new(0.4, 1.6, 1.5), now)?;
                let started = Instant::now();
                session.poll(now)?;
                times.push(started.elapsed().as_secs_f64() * 1000.0);
            }
        }
        let medians: Vec<f64> = times.into_iter().map(median).collect();
        for (((speed, loaded), session), ms) in speeds.iter_mut().zip(loaded).zip(&sessions).zip(&medians) {
            speed.cache_bytes = session.stats().cache_bytes;
            speed.samplers.push((label.clone(), loaded.engine.block_bytes(sampler), *ms, ms / medians[0]));
        }
    }
    Ok(speeds)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
