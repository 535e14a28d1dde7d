//! What is measured is there and adds up; how fast it is, is nobody's promise.

use super::*;
use visavis::internals::kernels::{Kernels, Scheme};

#[test]
fn a_bench_is_whole() {
    let engine = Engine::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors")).unwrap();
    for (sampler, threads) in [(Sampler::Midpoint4, 1), (Sampler::Single, 2)] {
        let bench =
            Bench::run(&engine, BenchOptions { sampler, threads, blocks: 12, ..BenchOptions::default() }).unwrap();
        let [p50, p95, p99, max] = bench.block_ms;
        assert!(0.0 < p50 && p50 <= p95 && p95 <= p99 && p99 <= max, "{bench:?}");
        assert!(bench.stages.unwrap().all().iter().all(|t| *t > 0.0), "every stage was seen: {bench:?}");
        assert!(bench.read_limit_gb_s > 0.0 && bench.weights_gb_s > 0.0);
        assert_eq!(bench.weight_bytes_a_block, engine.block_bytes(sampler));
        assert!((bench.frames_per_second * p50 - 4000.0).abs() < 1e-6);
        assert!(bench.first_frame_ms > 0.0 && bench.cache_bytes > 0);
    }
    for none in [BenchOptions { blocks: 0, ..Default::default() }, BenchOptions { sessions: 0, ..Default::default() }] {
        assert_eq!(Bench::run(&engine, none).unwrap_err().kind(), ErrorKind::Argument);
    }
}

#[test]
fn several_sessions_are_stepped_together() {
    let engine = Engine::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors")).unwrap();
    let options = BenchOptions { sessions: 4, blocks: 12, allocations: Some(|| 7), ..BenchOptions::default() };
    let bench = Bench::run(&engine, options).unwrap();
    assert_eq!((bench.sessions, bench.shared_blocks, bench.steady_allocations), (4, 4.0, Some(0)));
    assert!(bench.stages.is_none() && (bench.frames_per_second * bench.block_ms[0] - 16_000.0).abs() < 1e-6);
    let one = Bench::run(&engine, BenchOptions { blocks: 1, ..BenchOptions::default() }).unwrap();
    assert_eq!((bench.cache_bytes, one.steady_allocations), (4 * one.cache_bytes, None));
}

#[test]
fn one_and_two_threads_take_turns_beside_other_work() {
    let engine = Engine::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors")).unwrap();
    let options = LoadOptions { sampler: Sampler::Single, load: 2, every: Duration::from_millis(1), blocks: 30 };
    let measured = UnderLoad::run(&engine, options).unwrap();
    assert_eq!((measured.load, measured.blocks, measured.every_ms), (2, 30, 1.0));
    for times in measured.block_ms {
        let [mean, p50, p95, p99, max] = times.named().map(|(_, ms)| ms);
        assert!(0.0 < p50 && p50 <= p95 && p95 <= p99 && p99 <= max && mean <= max, "{times:?}");
    }
    assert_eq!(
        Times::of(&mut [4, 1, 3, 2].map(Duration::from_millis)).named().map(|(_, ms)| ms),
        [2.5, 2.0, 4.0, 4.0, 4.0]
    );
    let none = LoadOptions { blocks: 0, ..options };
    assert_eq!(UnderLoad::run(&engine, none).unwrap_err().kind(), ErrorKind::Argument);
}

#[test]
fn seeded_sizes_run_quantised() {
    let kernels = Kernels::detect().unwrap();
    let bytes: Vec<_> = [Scheme::F16, Scheme::I8]
        .map(|scheme| {
            let engine = Size::Base.engine(scheme, kernels).unwrap();
            let mut session = engine.session(SessionOptions::default()).unwrap();
            let frames = session.poll(0.0).unwrap().unwrap();
            assert!(frames.iter().all(|f| f.global.iter().all(|t| t.position.is_finite())), "{scheme}");
            engine.weight_bytes()
        })
        .to_vec();
    assert!(bytes.windows(2).all(|w| w[1] < w[0]), "int8 is smaller: {bytes:?}");
}

#[test]
fn sizes_have_names() {
    assert_eq!("paper".parse::<Size>().unwrap(), Size::Paper);
    assert_eq!("mid".parse::<Size>().unwrap(), Size::Mid);
    assert!("huge".parse::<Size>().unwrap_err().to_string().contains("paper, mid or base"));
}
