//! `visavis soak`: hours of motion, judged.

use super::{allocations, files, print};
use clap::Args;
use std::fmt::Write;
use std::io::IsTerminal;
use std::io::Write as _;
use std::path::PathBuf;
use visavis::{Engine, Error, ErrorKind, Result, Sampler};
use visavis_tools::soak::{Report, Soak, Voices};

#[derive(Debug, Args)]
pub struct SoakArgs {
    /// Hours of motion, computed as fast as they compute
    #[arg(long, value_name = "H", default_value = "1", allow_negative_numbers = true)]
    pub hours: f64,
    /// Hour of the session's time to start at: all counters stand as if it had run that long
    #[arg(long, value_name = "H", default_value = "0", allow_negative_numbers = true)]
    pub from_hour: f64,
    /// Prints JSON
    #[arg(long)]
    pub json: bool,
    /// Bundle [default: models/visavis-room-i8.safetensors here, beside the program, or in its
    /// source folder]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Best sampler; the student takes a part of each ten minutes if there is one
    #[arg(long, value_name = "NAME", default_value = "midpoint4")]
    pub sampler: Sampler,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u64,
}

pub fn run(args: &SoakArgs) -> Result<()> {
    let engine = Engine::load(files::model(args.model.as_deref())?)?;
    let talk = files::conversation()?;
    let voices = Voices::new(talk.agent().unwrap_or_default().to_vec(), talk.user().unwrap_or_default().to_vec())?;
    let soak = Soak { hours: args.hours, from_hour: args.from_hour, seed: args.seed, sampler: args.sampler };
    let terminal = std::io::stderr().is_terminal();
    let mut told = 0;
    let report = soak.run(&engine, &voices, Some(allocations::count), &mut |hours| {
        let percent = (100.0 * hours / args.hours) as u32;
        if terminal && percent > told {
            told = percent;
            // Progress that cannot be shown is not worth an error.
            let _ = write!(std::io::stderr(), "\r{hours:.2} of {} h\x1b[K", args.hours);
        }
    })?;
    if terminal {
        let _ = write!(std::io::stderr(), "\r\x1b[K");
    }
    if args.json {
        let json = serde_json::to_string_pretty(&report)
            .map_err(|e| Error::new(ErrorKind::State, format!("the report cannot be shown as JSON: {e}")))?;
        print(&(json + "\n"))?;
    } else {
        print(&text(&report))?;
    }
    let failed: Vec<_> = report.verdicts.iter().filter(|v| !v.passed).map(|v| v.name.as_str()).collect();
    if failed.is_empty() {
        return Ok(());
    }
    Err(Error::new(ErrorKind::State, format!("the soak failed: {}; see its report", failed.join(", "))))
}

fn text(report: &Report) -> String {
    let [p50, p95, p99, max] = report.block_ms;
    let mut text = format!(
        "soaked    {} h of motion from hour {} ({} blocks) in {:.0} s; re-anchored {} times\n\
         block     p50 {p50:.1}, p95 {p95:.1}, p99 {p99:.1}, max {max:.1} ms of 133.3 ms\n",
        report.hours, report.from_hour, report.blocks, report.seconds, report.anchorings
    );
    for verdict in &report.verdicts {
        let mark = if verdict.passed { "ok" } else { "FAILED" };
        // Writing to a string does not fail.
        let _ = writeln!(text, "{mark:<9} {:<19} {}", verdict.name, verdict.detail);
    }
    text
}
