//! `visavis calibrate`: measures what a model's gaze channel does, and writes it into its bundle.

use super::eval::show;
use super::{files, print};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use visavis::internals::config::{GazeConfig, GazeCurve};
use visavis::internals::kernels::Kernels;
use visavis::{BundleFile, Engine, Result};
use visavis_tools::eval::{Clip, calibrate};
use visavis_tools::export::write_atomically;

#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// Bundle
    #[arg(value_name = "IN")]
    pub input: PathBuf,
    /// Where the calibrated bundle goes
    #[arg(value_name = "OUT")]
    pub output: PathBuf,
    /// Clips in the format of the training corpus, best its validation split: a folder or one file
    #[arg(long, value_name = "DIR|FILE")]
    pub clips: PathBuf,
    /// Most windows of 13.3 s, spread over the clips, that the model is tried on; free gaze takes
    /// after all that the clips have
    #[arg(long, value_name = "N", default_value = "32", value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub windows: usize,
    /// Threads, each on windows of its own; the result is the same
    #[arg(long, value_name = "N", default_value = "2", value_parser = RangedU64ValueParser::<usize>::new().range(1..=64))]
    pub threads: usize,
}

pub fn run(args: &CalibrateArgs) -> Result<()> {
    files::apart(&args.input, &args.output)?;
    let file = BundleFile::open(&args.input)?;
    let engine = Engine::from_file(&file, Kernels::detect()?)?;
    let clips = Clip::list(&args.clips, &engine.config().rig)?;
    let stage = Mutex::new(String::new());
    let gaze = calibrate(&engine, &clips, args.windows, args.threads, &|p| show(&stage, p))?;
    let bytes = file.with_gaze(&gaze)?;
    write_atomically(&args.output, |w| w.write_all(&bytes))?;
    print(&summary(args, &gaze))
}

fn summary(args: &CalibrateArgs, gaze: &GazeConfig) -> String {
    let mut text = format!("{}\n", args.output.display());
    // Writing to a string does not fail.
    for (name, GazeCurve(points)) in gaze.curves() {
        let points: Vec<_> = points.iter().map(|[score, channel]| format!("{channel:.2}: {score:.2}")).collect();
        let _ = writeln!(text, "  {name:<9} channel: gaze score   {}", points.join("  "));
    }
    let levels: Vec<_> = gaze.levels.iter().map(|l| format!("{l:.2}")).collect();
    let _ = writeln!(text, "  free      stretches of {:.1} s at {}", gaze.seconds, levels.join(" "));
    text
}
