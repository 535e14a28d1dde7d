//! `visavis quantize`: a bundle of floats to int8, int4 or half floats.

use super::{files, print};
use clap::Args;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use visavis::internals::config::Kind;
use visavis::internals::kernels::Scheme;
use visavis::internals::quant::{Budget, Keep, Options, Quantised, SMALL, quantise};
use visavis::{BundleFile, Result};
use visavis_tools::export::write_atomically;

#[derive(Debug, Args)]
pub struct QuantizeArgs {
    /// Bundle of floats
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// Where the quantised bundle goes
    #[arg(value_name = "OUT")]
    pub output: PathBuf,
    /// f16, i8 or i4
    #[arg(long, value_name = "SCHEME")]
    pub scheme: Scheme,
    /// Layers that stay floats, f16 unless told otherwise; `*` stands for any characters, the last
    /// pattern that fits decides
    #[arg(long, value_name = "PATTERN[=f16|f32]")]
    pub keep: Vec<Keep>,
    /// Rounds each weight to the nearest value, instead of so that outputs on the sample
    /// conversation lose least; bundles of the kind dram always are
    #[arg(long)]
    pub plain: bool,
    /// Raises the layers that hurt most until blocks of the sample conversation are within this
    /// mean joint error, millimetres
    #[arg(long, value_name = "BUDGET_MM", value_parser = millimetres, allow_negative_numbers = true)]
    pub auto: Option<f64>,
}

fn millimetres(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && value <= 1000.0 => Ok(value),
        _ => Err("it is a number above 0, up to 1000".to_owned()),
    }
}

/// Blocks of the sample conversation that sensitivity is measured on.
const BLOCKS: usize = 24;

pub fn run(args: &QuantizeArgs) -> Result<()> {
    files::apart(&args.input, &args.output)?;
    let file = BundleFile::open(&args.input)?;
    let progress = |what: &str| {
        // Nobody is left to tell where stderr is closed.
        let _ = writeln!(std::io::stderr(), "{what}");
    };
    let budget = match args.auto {
        None => None,
        Some(mm) => Some(Budget { mm, scene: files::judged()?.scene(BLOCKS, None)?, progress: &progress }),
    };
    // Rounding to f16 has nothing to choose.
    // Statistics are taken of the flow model alone.
    let flow = file.parse()?.0.kind == Kind::Sarah;
    let calibrated = args.scheme != Scheme::F16 && !args.plain && flow;
    let calibration = match calibrated {
        true => Some(files::judged()?.scene(usize::MAX, None)?),
        false => None,
    };
    let options = Options {
        scheme: args.scheme,
        smallest: SMALL,
        keep: &args.keep,
        calibration: calibration.as_ref(),
        budget: budget.as_ref(),
    };
    let quantised = quantise(&file, &options)?;
    write_atomically(&args.output, |w| w.write_all(&quantised.bytes))?;
    print(&summary(args, &file, &quantised))
}

fn summary(args: &QuantizeArgs, file: &BundleFile<'_>, quantised: &Quantised) -> String {
    let mut counts = BTreeMap::<Scheme, usize>::new();
    quantised.schemes.values().for_each(|s| *counts.entry(*s).or_default() += 1);
    let counts: Vec<_> = counts.iter().map(|(scheme, n)| format!("{n} {scheme}")).collect();
    let (from, to) = (file.len() as f64, quantised.bytes.len() as f64);
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = writeln!(text, "{}: {:.2} MB of {:.2} MB ({:.3})", args.output.display(), to / 1e6, from / 1e6, to / from);
    let _ = writeln!(text, "  layers: {}", counts.join(", "));
    if let Some(choice) = &quantised.choice {
        let _ = writeln!(text, "  teacher-forced blocks: {:.3} mm, before {:.3} mm", choice.after_mm, choice.before_mm);
        for (name, scheme, mm) in choice.sensitivity.iter().take(8) {
            let _ = writeln!(text, "  {name} alone at {scheme}: {mm:.3} mm");
        }
        let raised: Vec<_> = choice.raised.iter().map(|(name, scheme)| format!("{name}={scheme}")).collect();
        let _ = writeln!(text, "  raised: {}", if raised.is_empty() { "nothing".to_owned() } else { raised.join(" ") });
    }
    text
}
