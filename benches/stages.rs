//! Stages of a block of the real networks, from a session's own probe, with seeded weights.
//!
//! `cargo bench --bench stages` (add `-- paper/i8` and so on to choose). Each figure is the time of
//! one stage in whole blocks that are computed one after the other, so caches are in the state that
//! a session leaves them in; `block` is all of them. Re-anchoring is off: it is spread over blocks,
//! and `visavis bench` shows what it adds.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use glam::Vec3;
use visavis::internals::frame::BLOCK_SAMPLES;
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::internals::session::Anchoring;
use visavis::{SAMPLE_RATE, Sampler, Session, SessionOptions};
use visavis_tools::bench::{STAGES, Size, StageTimes};

/// Computes `blocks` blocks; the time of stage `stage`, or of all.
fn blocks(session: &mut Session, samples: &[f32], blocks: u64, stage: Option<usize>) -> Duration {
    let mut times = StageTimes::default();
    for _ in 0..blocks {
        let now = session.next_due();
        let angle = 0.4 * now as f32;
        session.push_agent_audio(samples, SAMPLE_RATE).expect("audio");
        session.push_user_audio(samples, SAMPLE_RATE).expect("audio");
        session.push_user_head(Vec3::new(1.5 * angle.sin(), 1.65, 1.5 * angle.cos()), now).expect("a position");
        times.start();
        session.poll_with(now, Some(&mut times)).expect("a block");
    }
    let ms = stage.map_or_else(|| times.all().iter().sum(), |stage| times.all()[stage]);
    Duration::from_secs_f64(ms / 1000.0)
}

fn stages(c: &mut Criterion) {
    let kernels = Kernels::detect().expect("kernels");
    let samples: Vec<f32> = (0..BLOCK_SAMPLES).map(|i| 0.2 * (0.04 * i as f32).sin()).collect();
    for (size, name) in [(Size::Base, "base"), (Size::Mid, "mid"), (Size::Paper, "paper")] {
        for scheme in [Scheme::F16, Scheme::I8, Scheme::I4] {
            let engine = size.engine(scheme, kernels).expect("an engine");
            for sampler in [Sampler::Midpoint4, Sampler::Single] {
                let mut group = c.benchmark_group(format!("{name}/{scheme}/{sampler}"));
                for threads in [1, 2] {
                    let options = SessionOptions {
                        sampler,
                        threads,
                        diagnostics: Anchoring::Never.into(),
                        ..SessionOptions::default()
                    };
                    let mut session = engine.session(options).expect("a session");
                    blocks(&mut session, &samples, 100, None);
                    for (i, stage) in STAGES.iter().enumerate() {
                        group.bench_function(BenchmarkId::new(*stage, threads), |b| {
                            b.iter_custom(|iters| blocks(&mut session, &samples, iters, Some(i)));
                        });
                    }
                    group.bench_function(BenchmarkId::new("block", threads), |b| {
                        b.iter_custom(|iters| blocks(&mut session, &samples, iters, None));
                    });
                }
            }
        }
    }
}

fn quick() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600))
}

criterion_group! { name = benches; config = quick(); targets = stages }
criterion_main!(benches);
