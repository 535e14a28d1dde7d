//! `visavis calibrate`: measures what a model's gaze channel does, and what it does at rest as it is told, and writes it
//! into its bundle, with other defaults for sessions where they are given.

use super::eval::show;
use super::values::{GuidanceArgs, flow_time, temperature};
use super::{files, print};
use clap::Args;
use clap::builder::RangedU64ValueParser;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Mutex;
use visavis::internals::config::{Config, GazeConfig, ResponseCurve, RestConfig, RestResponse};
use visavis::internals::kernels::Kernels;
use visavis::{BundleFile, Engine, Error, ErrorKind, Result};
use visavis_tools::eval::{Clip, calibrate, calibrate_rest};
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
    /// after all that the clips have. As many minutes of each silence at rest, and five times as
    /// many windows in which agents listen
    #[arg(long, value_name = "N", default_value = "32", value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub windows: usize,
    /// Threads, each on windows of its own; the result is the same
    #[arg(long, value_name = "N", default_value = "2", value_parser = RangedU64ValueParser::<usize>::new().range(1..=64))]
    pub threads: usize,
    #[command(flatten)]
    pub weights: GuidanceArgs,
    /// Scale of the noise, 0 to 2 [default: the model's]
    #[arg(long, value_name = "T", value_parser = temperature, allow_negative_numbers = true)]
    pub temperature: Option<f32>,
    /// Flow time from which evaluations are conditional alone, 0 to 1; 1 guides all [default: the model's]
    #[arg(long, value_name = "TAU", value_parser = flow_time)]
    pub guided_until: Option<f32>,
    /// Scale of the noise of the single step, 0 to 2 [default: the model's]
    #[arg(long, value_name = "T", value_parser = temperature, allow_negative_numbers = true)]
    pub student_temperature: Option<f32>,
}

impl CalibrateArgs {
    /// The bundle's settings with those that were given.
    fn settings(&self, mut config: Config) -> Result<Config> {
        let session = &mut config.session;
        session.guidance = self.weights.guidance.unwrap_or(session.guidance);
        session.gaze_guidance = self.weights.gaze_guidance.unwrap_or(session.gaze_guidance);
        session.temperature = self.temperature.unwrap_or(session.temperature);
        session.guided_until = self.guided_until.or(session.guided_until).filter(|tau| *tau < 1.0);
        match (&mut config.student, self.student_temperature) {
            (Some(student), Some(t)) => student.temperature = Some(t),
            (None, Some(_)) => {
                let text = "--student-temperature: this bundle has no student network";
                return Err(Error::new(ErrorKind::Argument, text));
            }
            (_, None) => {}
        }
        Ok(config)
    }
}

pub fn run(args: &CalibrateArgs) -> Result<()> {
    files::apart(&args.input, &args.output)?;
    let file = BundleFile::open(&args.input)?;
    let mut settings = args.settings(file.parse()?.0)?;
    let file = BundleFile::from_bytes(file.with_settings(&settings)?, &args.input);
    let engine = Engine::from_file(&file, Kernels::detect()?)?;
    let clips = Clip::list(&args.clips, &engine.config().rig)?;
    let stage = Mutex::new(String::new());
    let gaze = calibrate(&engine, &clips, args.windows, args.threads, &|p| show(&stage, p))?;
    let mut text = summary(args, &gaze);
    settings.gaze = Some(gaze);
    if let Some(rest) = &settings.rest {
        // Free gaze is part of how a body rests.
        let with = |rest: &RestConfig| {
            let settings = Config { rest: Some(rest.clone()), ..settings.clone() };
            let file = BundleFile::from_bytes(file.with_settings(&settings)?, &args.input);
            Engine::from_file(&file, Kernels::detect()?)
        };
        let rest = calibrate_rest(rest, &clips, args.windows, &with, args.threads, &|p| show(&stage, p))?;
        text += &rest_summary(&rest);
        settings.rest = Some(rest);
    }
    let bytes = file.with_settings(&settings)?;
    write_atomically(&args.output, |w| w.write_all(&bytes))?;
    print(&text)
}

fn summary(args: &CalibrateArgs, gaze: &GazeConfig) -> String {
    let mut text = format!("{}\n", args.output.display());
    // Writing to a string does not fail.
    for (name, ResponseCurve(points)) in gaze.curves() {
        let points: Vec<_> = points.iter().map(|[score, channel]| format!("{channel:.2}: {score:.2}")).collect();
        let _ = writeln!(text, "  {name:<9} channel: gaze score   {}", points.join("  "));
    }
    let levels: Vec<_> = gaze.levels.iter().map(|l| format!("{l:.2}")).collect();
    let _ = writeln!(text, "  free      stretches of {:.1} s at {}", gaze.seconds, levels.join(" "));
    text
}

/// What the networks are asked for at rest beside the stretches of people: stirring, hands, head.
fn rest_summary(rest: &RestConfig) -> String {
    let offsets = |values: &[f32]| values.iter().map(|v| format!("{v:+.2}")).collect::<Vec<_>>().join(" ");
    let line = |(name, response): (&str, &RestResponse)| {
        let (alone, listening) = (offsets(&response.alone), offsets(&response.listening));
        format!(
            "  rest      {name}: told the same for {:.1} s; alone {alone}   listening {listening}\n",
            response.seconds
        )
    };
    rest.responses().map(line).collect()
}
