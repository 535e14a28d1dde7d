//! `visavis report`: what quantised bundles lose and what they cost.

use super::{files, print};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Result};
use visavis_tools::export::write_atomically;
use visavis_tools::report::{self, Numerics, Options, Report};

#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Bundle of floats that the candidates were made from
    #[arg(long, value_name = "FILE")]
    pub reference: PathBuf,
    /// Bundles to compare with it
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    pub candidate: Vec<PathBuf>,
    /// Folder for report.html, report.md and report.json
    #[arg(long, value_name = "DIR", required_unless_present = "numerics_only")]
    pub out: Option<PathBuf>,
    /// Length of the free runs, minutes
    #[arg(long, value_name = "N", default_value_t = 10.0, value_parser = minutes, allow_negative_numbers = true)]
    pub minutes: f64,
    /// Blocks that are compared teacher-forced [default: 240, as many as the sample conversation
    /// has]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<u32>::new().range(1..=10_000))]
    pub blocks: Option<u32>,
    /// What `visavis eval --json` wrote for the reference and for each candidate, on the same clips
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub eval: Vec<PathBuf>,
    /// The same for the reference with another --seed: what chance alone changes
    #[arg(long, value_name = "FILE", requires = "eval")]
    pub eval_other_seed: Option<PathBuf>,
    /// A few blocks of everything: to see that it works
    #[arg(long)]
    pub quick: bool,
    /// Writes the numbers that do not depend on the machine, and nothing else
    #[arg(long, value_name = "FILE")]
    pub numerics_only: Option<PathBuf>,
    /// Numbers that --numerics-only wrote on another machine, to be compared with this one's
    #[arg(long, value_name = "FILE")]
    pub other_machine: Option<PathBuf>,
}

fn minutes(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value <= 60.0 => Ok(value),
        _ => Err("it is a number above 0, up to 60".to_owned()),
    }
}

pub fn run(args: &ReportArgs) -> Result<()> {
    let progress = |what: &str| {
        // Nobody is left to tell where stderr is closed.
        let _ = writeln!(std::io::stderr(), "{what}");
    };
    let other = args.other_machine.as_deref().map(read).transpose()?;
    let options = Options {
        reference: args.reference.clone(),
        candidates: args.candidate.clone(),
        talk: &files::judged()?,
        blocks: args.blocks.unwrap_or(if args.quick { 12 } else { 240 }) as usize,
        minutes: if args.quick { 0.2 } else { args.minutes },
        timed: if args.quick { 10 } else { 200 },
        other,
        eval: args.eval.clone(),
        eval_other_seed: args.eval_other_seed.clone(),
        progress: &progress,
    };
    if let Some(file) = &args.numerics_only {
        let numerics = report::numerics(&options)?;
        return write_atomically(file, |w| w.write_all(json(&numerics)?.as_bytes()));
    }
    // Clap asks for a folder where there is no file of numerics.
    let out = args.out.as_deref().unwrap_or(Path::new("."));
    std::fs::create_dir_all(out).map_err(|e| Error::io("make the output folder", out, e))?;
    let report = report::run(&options)?;
    write_atomically(out.join("report.json"), |w| w.write_all(json(&report)?.as_bytes()))?;
    write_atomically(out.join("report.md"), |w| w.write_all(report.markdown().as_bytes()))?;
    write_atomically(out.join("report.html"), |w| w.write_all(report.html().as_bytes()))?;
    print(&summary(&report, out))
}

fn summary(report: &Report, out: &Path) -> String {
    let mut text = String::new();
    for (c, targets) in report.numerics.candidates.iter().zip(&report.targets) {
        for t in targets {
            let measured = t.measured.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}"));
            text += &format!("{:<24} {:<40} {measured:>10}  at most {:<8} {}\n", c.name, t.what, t.target, t.verdict());
        }
    }
    text + &format!("{}\n", out.join("report.html").display())
}

fn read(path: &Path) -> Result<Numerics> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io("read the other machine's numerics", path, e))?;
    serde_json::from_str(&text).map_err(|e| {
        let message = format!("is not what --numerics-only writes ({e}); make it again with this version");
        Error::new(ErrorKind::Argument, message).with_path(path)
    })
}

fn json(value: &impl serde::Serialize) -> std::io::Result<String> {
    serde_json::to_string_pretty(value).map(|text| text + "\n").map_err(std::io::Error::other)
}
