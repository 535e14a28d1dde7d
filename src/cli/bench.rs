//! `visavis bench`: how fast a bundle, or a size, runs here.

use super::{files, print};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;
use visavis::bench::{Bench, BenchOptions, Machine, STAGES, Size};
use visavis::engine::Engine;
use visavis::error::Result;
use visavis::frame::Sampler;
use visavis::kernels::{Kernels, Scheme};

#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Bundle [default: the shipped one]
    #[arg(long, value_name = "FILE", conflicts_with = "size")]
    pub model: Option<PathBuf>,
    /// Seeded weights of a size instead of a bundle: paper or base
    #[arg(long, value_name = "SIZE")]
    pub size: Option<Size>,
    /// How the weights of --size are stored: f32, f16, i8 or i4
    #[arg(long, value_name = "SCHEME", default_value = "i8", requires = "size")]
    pub scheme: Scheme,
    /// midpoint4, midpoint2, midpoint1, euler:N or single
    #[arg(long, value_name = "NAME", num_args = 1.., default_values = ["midpoint4", "single"])]
    pub sampler: Vec<Sampler>,
    /// Threads, 1 or 2, or both one after the other: 1,2
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1,2", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=2))]
    pub threads: Vec<usize>,
    /// Blocks that are timed
    #[arg(long, value_name = "N", default_value = "200", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1_000_000))]
    pub blocks: usize,
    /// Prints JSON: the machine, the kernels, a list of measurements
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &BenchArgs) -> Result<()> {
    let started = std::time::Instant::now();
    let engine = match args.size {
        Some(size) => size.engine(args.scheme, Kernels::detect()?)?,
        None => Engine::load(files::model(args.model.as_deref())?)?,
    };
    let load_ms = 1000.0 * started.elapsed().as_secs_f64();
    let (machine, kernels) = (Machine::here(), engine.kernels());
    let mut benches = Vec::new();
    for &sampler in &args.sampler {
        for &threads in &args.threads {
            benches.push(Bench::run(&engine, BenchOptions { sampler, threads, blocks: args.blocks })?);
        }
    }
    if args.json {
        let variants: serde_json::Map<_, _> =
            kernels.variants().iter().map(|(name, v)| ((*name).to_owned(), (*v).into())).collect();
        let all = serde_json::json!({
            "machine": machine, "level": kernels.level().to_string(), "kernels": variants, "load_ms": load_ms, "benches": benches,
        });
        return print(&format!("{all:#}\n"));
    }
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(text, "{} ({} processors), {} kernels", machine.cpu, machine.processors, kernels.level());
    let made = if args.size.is_some() { "drawn and packed" } else { "loaded" };
    let _ = writeln!(text, "{}, {made} in {load_ms:.0} ms", engine.config().name);
    benches.iter().for_each(|bench| text.push_str(&lines(bench)));
    print(&text)
}

fn lines(b: &Bench) -> String {
    let [p50, p95, p99, max] = b.block_ms;
    let stages: Vec<_> = STAGES.iter().zip(b.stages.all()).map(|(name, time)| format!("{name} {time:.2}")).collect();
    let resident = b.peak_resident_bytes.map_or_else(|| "unknown".into(), |bytes| format!("{} MB", bytes / 1_000_000));
    format!(
        "\n{}, {} thread{}: {:.0} frames/s, {:.1} x real time\n  block    p50 {p50:.2}, p95 {p95:.2}, p99 {p99:.2}, max {max:.2} ms of 133.3 ms\n  \
         stages   {} ms\n  weights  {:.1} MB a block, {:.1} GB/s; a reading loop gets {:.1} GB/s here now\n  \
         memory   weights {} MB, caches {} MB, peak resident {resident}\n  start    first frame {:.0} ms after the engine\n",
        b.sampler,
        b.threads,
        if b.threads == 1 { "" } else { "s" },
        b.frames_per_second,
        b.real_time_factor,
        stages.join(", "),
        b.weight_bytes_a_block as f64 / 1e6,
        b.weights_gb_s,
        b.read_limit_gb_s,
        b.weight_bytes / 1_000_000,
        b.cache_bytes / 1_000_000,
        b.first_frame_ms,
    )
}
