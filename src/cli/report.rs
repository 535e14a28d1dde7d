//! `visavis report`: what quantised bundles lose and what they cost.

use super::args::ReportArgs;
use super::{files, print};
use std::io::Write as _;
use std::path::Path;
use visavis::error::{Error, ErrorKind, Result};
use visavis::export::write_atomically;
use visavis::report::{self, Numerics, Options, Report};

pub fn run(args: &ReportArgs) -> Result<()> {
    let progress = |what: &str| {
        // Nobody is left to tell where stderr is closed.
        let _ = writeln!(std::io::stderr(), "{what}");
    };
    let other = args.other_machine.as_deref().map(read).transpose()?;
    let options = Options {
        reference: args.reference.clone(),
        candidates: args.candidate.clone(),
        talk: &files::conversation()?,
        blocks: args.blocks.unwrap_or(if args.quick { 12 } else { 240 }) as usize,
        minutes: if args.quick { 0.2 } else { args.minutes },
        timed: if args.quick { 10 } else { 200 },
        other,
        eval: args.eval.clone(),
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
