//! `visavis quantize`: a bundle of floats to int8, int4 or half floats.

use super::args::QuantizeArgs;
use super::{files, print};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use visavis::bundle::BundleFile;
use visavis::error::{Error, ErrorKind, Result};
use visavis::export::write_atomically;
use visavis::kernels::Scheme;
use visavis::quant::{Budget, Options, Quantised, SMALL, Scene, quantise};

/// Blocks of the sample conversation that sensitivity is measured on.
const BLOCKS: usize = 24;

pub fn run(args: &QuantizeArgs) -> Result<()> {
    let same = args.input.canonicalize().ok().zip(args.output.canonicalize().ok()).is_some_and(|(a, b)| a == b);
    if same {
        let message = "the result would take the place of the bundle it is made from; give another name";
        return Err(Error::new(ErrorKind::Argument, message).with_path(&args.output));
    }
    let file = BundleFile::open(&args.input)?;
    let progress = |what: &str| {
        // Nobody is left to tell where stderr is closed.
        let _ = writeln!(std::io::stderr(), "{what}");
    };
    let budget = match args.auto {
        None => None,
        Some(mm) => Some(Budget { mm, scene: Scene::new(&files::conversation()?, BLOCKS, None)?, progress: &progress }),
    };
    // Rounding to f16 has nothing to choose.
    let calibrated = args.scheme != Scheme::F16 && !args.plain;
    let calibration = match calibrated {
        true => Some(Scene::new(&files::conversation()?, usize::MAX, None)?),
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
