//! `visavis eval`: a bundle judged on recorded conversations.

use super::values::{GuidanceArgs, temperature};
use super::{files, print};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use visavis::{Engine, Result, Sampler, SessionOptions};
use visavis_tools::eval::{Clip, EvalOptions, EvalProgress, evaluate, synthetic};
use visavis_tools::export::write_atomically;

#[derive(Debug, Args)]
pub struct EvalArgs {
    /// Bundle [default: the shipped one]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Clips in the format of the training corpus: a folder or one file [default: a procedural
    /// person in the sample conversation, good for a look only]
    #[arg(long, value_name = "DIR|FILE")]
    pub clips: Option<PathBuf>,
    /// Clips that Random and NN look up their motion in, best those of training [default: the other
    /// clips]
    #[arg(long, value_name = "DIR")]
    pub bank: Option<PathBuf>,
    /// Most windows of 13.3 s, spread over the clips [default: 64; 4 with --quick]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub windows: Option<usize>,
    /// Threads, each on windows of its own; the figures are the same
    #[arg(long, value_name = "N", default_value = "2", value_parser = RangedU64ValueParser::<usize>::new().range(1..=64))]
    pub threads: usize,
    /// Samplers, the reference first [default: midpoint4 midpoint2 midpoint1 single]
    #[arg(long, value_name = "NAME", num_args = 1..)]
    pub sampler: Vec<Sampler>,
    #[command(flatten)]
    pub weights: GuidanceArgs,
    /// Scale of the noise, 0 to 2 [default: the model's]
    #[arg(long, value_name = "T", value_parser = temperature, allow_negative_numbers = true)]
    pub temperature: Option<f32>,
    /// Writes the report as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Writes the report as Markdown
    #[arg(long, value_name = "FILE")]
    pub md: Option<PathBuf>,
    /// A look: four windows and few, short runs
    #[arg(long)]
    pub quick: bool,
    /// Only what bundles are compared by: motion with free gaze, and reconstruction; not Random and
    /// NN, neither measured nor kept
    #[arg(long)]
    pub motion_only: bool,
    /// Writes the motion of each row but those with gaze targets, as it is played: a clip for each
    /// window, DIR/ROW/000.safetensors and on, of 400 frames in the space of the window's clip. ROW
    /// is the row's name, - for a colon; the file tells clip and first frame, the corpus' ones also
    /// hold voices and the user's head. DIR is new or empty
    #[arg(long, value_name = "DIR")]
    pub keep: Option<PathBuf>,
    /// A row of motion made elsewhere: DIR holds a clip for each window, as --keep writes them
    #[arg(long, value_name = "NAME=DIR", value_parser = row)]
    pub row: Vec<(String, PathBuf)>,
    /// Seed of all windows; another one tells what chance alone changes
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
}

fn row(text: &str) -> std::result::Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, dir)) if !name.is_empty() && !dir.is_empty() => Ok((name.to_owned(), dir.into())),
        _ => Err("it is NAME=DIR, a row's name and the folder of its motion".to_owned()),
    }
}

pub fn run(args: &EvalArgs) -> Result<()> {
    let engine = Engine::load(files::model(args.model.as_deref())?)?;
    let mut options = EvalOptions {
        threads: args.threads,
        quick: args.quick,
        motion_only: args.motion_only,
        seed: args.seed,
        rows: args.row.clone(),
        keep: args.keep.clone(),
        session: SessionOptions {
            guidance: args.weights.guidance,
            gaze_guidance: args.weights.gaze_guidance,
            temperature: args.temperature,
            ..SessionOptions::default()
        },
        ..EvalOptions::default()
    };
    if args.quick {
        options.windows = 4;
    }
    options.windows = args.windows.unwrap_or(options.windows);
    if !args.sampler.is_empty() {
        options.samplers.clone_from(&args.sampler);
    }
    let rig = &engine.config().rig;
    let clips = match &args.clips {
        Some(path) => Clip::list(path, rig)?,
        None => synthetic(rig, &files::conversation()?),
    };
    let bank = args.bank.as_ref().map(|path| Clip::list(path, rig)).transpose()?;
    let stage = Mutex::new(String::new());
    let report = evaluate(&engine, &clips, bank.as_deref(), &options, &|p| show(&stage, p))?;
    for (path, text) in [(&args.json, report.to_json()), (&args.md, report.to_markdown())] {
        if let Some(path) = path {
            write_atomically(path, |w| w.write_all(text.as_bytes()))?;
        }
    }
    print(&report.to_text())
}

/// Progress on stderr: each stage once, and on a terminal how many windows of it are done.
pub(super) fn show(stage: &Mutex<String>, p: EvalProgress<'_>) {
    let Ok(mut last) = stage.lock() else { return };
    let fresh = *last != p.stage;
    p.stage.clone_into(&mut last);
    let mut err = std::io::stderr();
    // Progress that cannot be shown is not worth an error.
    let _ = match (err.is_terminal(), p.total) {
        (true, 0) => write!(err, "\r{}\x1b[K\r", p.stage),
        (true, total) => write!(err, "\r{} {} of {total}\x1b[K\r", p.stage, p.done),
        (false, _) if fresh => writeln!(err, "{}", p.stage),
        _ => Ok(()),
    };
}
