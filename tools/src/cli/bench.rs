//! `visavis bench`: how fast a bundle, or a size, runs here.

use super::cold_start::{self, ColdStart};
use super::{allocations, files, print};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::{BundleFile, Engine, Networks, Result, Sampler};
use visavis_tools::bench::{
    Bench, BenchOptions, LoadOptions, Machine, STAGES, Size, SoundOptions, UnderLoad, WithSounds,
};
use visavis_tools::contents::made_with;

#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Bundle [default: the shipped one]
    #[arg(long, value_name = "FILE", conflicts_with = "size")]
    pub model: Option<PathBuf>,
    /// Seeded weights of a size instead of a bundle: paper, mid or base
    #[arg(long, value_name = "SIZE")]
    pub size: Option<Size>,
    /// How the weights of --size are stored: f32, f16, i8 or i4
    #[arg(long, value_name = "SCHEME", default_value = "i8", requires = "size")]
    pub scheme: Scheme,
    /// midpoint4, midpoint2, midpoint1, euler:N or single, or several: midpoint4,single
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',', default_values = ["midpoint4", "single"])]
    pub sampler: Vec<Sampler>,
    /// Networks to load: all, or those that the samplers need and no encoder, so no re-anchoring
    /// (lean)
    #[arg(long, value_name = "SET", default_value = "all")]
    pub networks: NetworkSet,
    /// Threads, 1 or 2, or both one after the other: 1,2
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1,2", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=2))]
    pub threads: Vec<usize>,
    /// Sessions that are stepped together, or several numbers one after the other: 1,4
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub sessions: Vec<usize>,
    /// Blocks that are timed
    #[arg(long, value_name = "N", default_value = "200", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1_000_000))]
    pub blocks: usize,
    /// Seconds of sound that each session's voices have room for, 0.5 to 60
    #[arg(long, value_name = "S", default_value = "60", conflicts_with = "load")]
    pub voice_ahead: f64,
    /// Measures beside N threads that do nothing but compute, with one thread and with two in
    /// turns: these times alone. Or several numbers one after the other: 0,1,2
    #[arg(long, value_name = "N", num_args = 1.., value_delimiter = ',', value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(0..=64), conflicts_with_all = ["threads", "sessions"])]
    pub load: Vec<usize>,
    /// With --load: milliseconds from one block's start to the next's, at least; a conversation's
    /// are 133.3
    #[arg(long, value_name = "MS", default_value = "0", requires = "load", value_parser = milliseconds)]
    pub every: f64,
    /// Measures blocks that hear N sources in the room and blocks that hear none, in turns: these
    /// times alone. Or several numbers one after the other: 1,16. Seeded weights (--size) have
    /// hearing then
    #[arg(long, value_name = "N", num_args = 1.., value_delimiter = ',', value_parser = clap::builder::RangedU64ValueParser::<u32>::new().range(0..=16), conflicts_with_all = ["load", "sessions"])]
    pub sounds: Vec<u32>,
    /// With --sounds: two microphones at the agent's ears hear something as well
    #[arg(long, requires = "sounds")]
    pub ears: bool,
    /// Leaves out the cold start, for which processes of their own load the bundle
    #[arg(long)]
    pub no_cold_start: bool,
    /// What the cold start is measured by: loads, makes the first frame, says so, goes on for the
    /// blocks
    #[arg(long, hide = true, requires = "model")]
    pub child: bool,
    /// Prints JSON: the machine, the kernels, a list of measurements
    #[arg(long)]
    pub json: bool,
}

/// Which networks are loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum NetworkSet {
    /// All of the bundle.
    All,
    /// Those that the samplers need, without the encoder.
    Lean,
}

impl NetworkSet {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Lean => "lean",
        }
    }

    pub(super) fn of(self, samplers: &[Sampler]) -> Networks {
        match self {
            Self::All => Networks::default(),
            Self::Lean => Networks {
                reference: samplers.iter().any(|sampler| *sampler != Sampler::Single),
                student: samplers.contains(&Sampler::Single),
                encoder: false,
                modulation: samplers.iter().any(|s| matches!(s, Sampler::Euler(n) if ![1, 2, 4, 8].contains(&n.get()))),
            },
        }
    }
}

pub fn run(args: &BenchArgs) -> Result<()> {
    if let (true, Some(path)) = (args.child, &args.model) {
        return cold_start::child(args, path);
    }
    let started = std::time::Instant::now();
    let networks = args.networks.of(&args.sampler);
    let engine = match args.size {
        Some(size) if !args.sounds.is_empty() => size.engine_with_hearing(args.scheme, Kernels::detect()?, networks)?,
        Some(size) => size.engine_with(args.scheme, Kernels::detect()?, networks)?,
        None => {
            let file = BundleFile::open(files::model(args.model.as_deref())?)?;
            Engine::from_file_with(&file, Kernels::detect()?, networks)?
        }
    };
    let load_ms = 1000.0 * started.elapsed().as_secs_f64();
    let (machine, kernels) = (Machine::here(), engine.kernels());
    let mut benches = Vec::new();
    let allocations: Option<fn() -> u64> = Some(allocations::count);
    // Where there are no samplers, they are all the same.
    let samplers = if engine.needs_sarah().is_ok() { &args.sampler[..] } else { &args.sampler[..1] };
    if !args.load.is_empty() {
        return under_load(args, samplers, &engine, &machine);
    }
    if !args.sounds.is_empty() {
        return with_sounds(args, samplers, &engine, &machine);
    }
    for &sampler in samplers {
        for &threads in &args.threads {
            for &sessions in &args.sessions {
                let options = BenchOptions {
                    sampler,
                    threads,
                    sessions,
                    blocks: args.blocks,
                    voice_ahead: args.voice_ahead,
                    allocations,
                };
                benches.push(Bench::run(&engine, options)?);
            }
        }
    }
    let cold = if args.no_cold_start { Ok(Vec::new()) } else { cold_starts(args, &engine, samplers)? };
    if args.json {
        let variants: serde_json::Map<_, _> =
            kernels.variants().iter().map(|(name, v)| ((*name).to_owned(), (*v).into())).collect();
        let all = serde_json::json!({
            "machine": machine, "level": kernels.level().to_string(), "kernels": variants, "load_ms": load_ms, "benches": benches,
            "cold_start": cold.unwrap_or_default(),
        });
        return print(&format!("{all:#}\n"));
    }
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(text, "{} ({} processors), {} kernels", machine.cpu, machine.processors, kernels.level());
    let _ = writeln!(
        text,
        "{}",
        kernels.variants().iter().map(|(name, v)| format!("{name} {v}")).collect::<Vec<_>>().join(", ")
    );
    let made = if args.size.is_some() { "drawn and packed" } else { "loaded" };
    let _ = writeln!(text, "{}, {made} in {load_ms:.0} ms", engine.config().name);
    benches.iter().for_each(|bench| text.push_str(&lines(bench)));
    match cold {
        Ok(cold) if cold.is_empty() => {}
        Ok(cold) => cold.iter().for_each(|c| text += &format!("\n{}", c.line())),
        Err(e) => text += &format!("\ncold start not measured: {e}\n"),
    }
    print(&text)
}

fn milliseconds(text: &str) -> std::result::Result<f64, String> {
    let ms = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=10_000.0).contains(&ms) { Ok(ms) } else { Err("0 to 10000".to_owned()) }
}

/// Prints the times beside other work.
fn under_load(args: &BenchArgs, samplers: &[Sampler], engine: &Arc<Engine>, machine: &Machine) -> Result<()> {
    let mut all = Vec::new();
    for &sampler in samplers {
        for &load in &args.load {
            let every = Duration::from_secs_f64(args.every / 1000.0);
            all.push(UnderLoad::run(engine, LoadOptions { sampler, load, every, blocks: args.blocks })?);
        }
    }
    if args.json {
        return print(&format!("{:#}\n", serde_json::json!({ "machine": machine, "under_load": all })));
    }
    let mut text = format!("{} ({} processors), {}\n", machine.cpu, machine.processors, engine.config().name);
    for UnderLoad { sampler, load, block_ms: [one, two], .. } in &all {
        let _ = writeln!(text, "\n{sampler} beside {load} busy thread{}", if *load == 1 { "" } else { "s" });
        let mut line = |name: &str, times: [(&str, f64); 5], unit: &str| {
            let times = times.map(|(name, value)| format!("{name} {value:.2}"));
            let _ = writeln!(text, "  {name:<9} {}{unit}", times.join(", "));
        };
        line("1 thread", one.named(), " ms");
        line("2 threads", two.named(), " ms");
        let mut ratios = two.named();
        ratios.iter_mut().zip(one.named()).for_each(|((_, two), (_, one))| *two /= one);
        line("2 to 1", ratios, "");
    }
    print(&text)
}

/// Prints the times with and without sounds in the room.
fn with_sounds(args: &BenchArgs, samplers: &[Sampler], engine: &Arc<Engine>, machine: &Machine) -> Result<()> {
    let mut all = Vec::new();
    for &sampler in samplers {
        for &threads in &args.threads {
            for &sources in &args.sounds {
                let options = SoundOptions { sampler, threads, sources, ears: args.ears, blocks: args.blocks };
                all.push(WithSounds::run(engine, options)?);
            }
        }
    }
    if args.json {
        return print(&format!("{:#}\n", serde_json::json!({ "machine": machine, "with_sounds": all })));
    }
    let mut text = format!("{} ({} processors), {}\n", machine.cpu, machine.processors, engine.config().name);
    for WithSounds { sampler, threads, sources, ears, block_ms: [without, with], .. } in &all {
        let also = if *ears { " and ears" } else { "" };
        let _ = writeln!(text, "\n{sampler}, {threads} threads, {sources} sources{also}");
        for (name, times) in [("without", without), ("with", with)] {
            let times = times.named().map(|(name, value)| format!("{name} {value:.2}"));
            let _ = writeln!(text, "  {name:<9} {} ms", times.join(", "));
        }
        let more = 100.0 * (with.p50 / without.p50 - 1.0);
        let _ = writeln!(text, "  more      {more:.1} % at the median, {:.2} ms", with.p50 - without.p50);
    }
    print(&text)
}

/// The cold start with each sampler and number of threads; the inner error where no process could
/// be started.
fn cold_starts(args: &BenchArgs, engine: &Engine, samplers: &[Sampler]) -> Result<std::io::Result<Vec<ColdStart>>> {
    let file = match args.size {
        Some(size) => cold_start::File::drawn(size, args.scheme)?,
        None => cold_start::File::of(files::model(args.model.as_deref())?),
    };
    let each = samplers.iter().flat_map(|sampler| args.threads.iter().map(move |threads| (*sampler, *threads)));
    let measure = |(sampler, threads)| {
        let mut cold = cold_start::measure(&file, sampler, threads, args.networks)?;
        cold.sampler = made_with(engine, sampler);
        Ok(cold)
    };
    Ok(each.map(measure).collect())
}

fn lines(b: &Bench) -> String {
    let [p50, p95, p99, max] = b.block_ms;
    let many = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    let megabytes = |bytes: Option<u64>| bytes.map_or_else(|| "unknown".into(), |b| format!("{} MB", b / 1_000_000));
    let mut text = format!(
        "\n{}, {}, {}: {:.0} frames/s, {:.1} x real time\n",
        b.sampler,
        many(b.threads, "thread"),
        many(b.sessions, "session"),
        b.frames_per_second,
        b.real_time_factor,
    );
    let mut line = |name: &str, what: String| text.push_str(&format!("  {name:<8} {what}\n"));
    line("block", format!("p50 {p50:.2}, p95 {p95:.2}, p99 {p99:.2}, max {max:.2} ms of 133.3 ms"));
    if let Some(stages) = &b.stages {
        let stages: Vec<_> = STAGES.iter().zip(stages.all()).map(|(name, time)| format!("{name} {time:.2}")).collect();
        line("stages", format!("{} ms", stages.join(", ")));
    } else {
        line("shared", format!("{:.1} of {} blocks shared passes over the weights", b.shared_blocks, b.sessions));
    }
    line(
        "weights",
        format!(
            "{:.1} MB a block and session, {:.1} GB/s; a reading loop gets {:.1} GB/s here now: {:.0} % of it for one session's",
            b.weight_bytes_a_block as f64 / 1e6,
            b.weights_gb_s,
            b.read_limit_gb_s,
            100.0 * b.share_of_read_limit,
        ),
    );
    if b.state_bytes_a_session < 1_000_000 {
        line("state", format!("{:.1} KB a session, beside its voices", b.state_bytes_a_session as f64 / 1024.0));
    }
    line(
        "memory",
        format!(
            "weights {:.1} MB, caches {:.1} MB, resident {}, at most {}",
            b.weight_bytes as f64 / 1e6,
            b.cache_bytes as f64 / 1e6,
            megabytes(b.resident_bytes),
            megabytes(b.peak_resident_bytes),
        ),
    );
    if let Some(calls) = b.steady_allocations {
        line("steady", many(calls as usize, "allocation"));
    }
    line("start", format!("first frame {:.0} ms after the engine", b.first_frame_ms));
    text
}
