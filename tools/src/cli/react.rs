//! `visavis react`: sounds around the agent in, a folder of results out.

use super::{files, print};
use clap::builder::{PossibleValuesParser, RangedU64ValueParser};
use std::path::PathBuf;
use visavis::internals::kernels::Kernels;
use visavis::internals::mospa::Reactor;
use visavis::{BundleFile, Result};
use visavis_tools::export::viewer::Meta;
use visavis_tools::metrics::Summary;
use visavis_tools::offline::OutputFolder;
use visavis_tools::react::{self, Options, Outcome, Sound};

/// Sensitivities as the model numbers them.
const SENSITIVITIES: [&str; 3] = ["dull", "neutral", "sensitive"];

#[derive(Debug, Clone, clap::Args)]
pub struct ReactArgs {
    /// Bundle of the kind mospa [default: the shipped one, models/visavis-mospa-i8.safetensors]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// A sound: WAV file, where it is (metres; the agent stands at the origin facing +z, +x is its
    /// left, y is up from the floor) and when it begins (seconds). Up to 16
    #[arg(long, value_name = "WAV@X,Y,Z[:t=S]", required = true)]
    pub sound: Vec<String>,
    /// How readily the agent reacts; left out, the model is not told
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(SENSITIVITIES))]
    pub sensitivity: Option<String>,
    /// Steps of sampling, 1 to 1000 [default: the bundle's]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..=1000))]
    pub steps: Option<usize>,
    /// Seed of the noise: same seed and sounds, same motion
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u64,
    /// Threads, 1 or 2; the motion is the same
    #[arg(long, value_name = "N", default_value = "1", value_parser = RangedU64ValueParser::<usize>::new().range(1..=2))]
    pub threads: usize,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/react")]
    pub out: PathBuf,
}

pub fn run(args: &ReactArgs) -> Result<()> {
    let out = OutputFolder::prepare(&args.out)?;
    let sounds = args.sound.iter().map(|text| Sound::read(text)).collect::<Result<Vec<_>>>()?;
    let kernels = Kernels::detect()?;
    let reactor = Reactor::load(&BundleFile::open(&files::clip_model(args.model.as_deref())?)?, kernels)?;
    let told = args.sensitivity.as_deref().and_then(|name| SENSITIVITIES.iter().position(|s| *s == name));
    let sensitivity = told.and_then(|i| u8::try_from(i).ok());
    let options = Options { sensitivity, steps: args.steps, seed: args.seed, threads: args.threads };
    let outcome = react::run(&reactor, &sounds, &options)?;
    let summary = Summary::of(&outcome.recording);
    let config = reactor.config();
    let facts = [
        ("model", config.name.clone()),
        ("about the model", config.description.clone()),
        ("steps", outcome.steps.to_string()),
        ("sensitivity", args.sensitivity.clone().unwrap_or_else(|| "not told".to_owned())),
        ("place told to the model", sounds[outcome.told].name.clone()),
        ("seed", args.seed.to_string()),
        ("kernels", kernels.level().to_string()),
        ("made by", format!("visavis {}", env!("CARGO_PKG_VERSION"))),
        ("licence of the model", config.licence.clone()),
    ];
    let names: Vec<_> = sounds.iter().map(|sound| sound.name.as_str()).collect();
    let facts = facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    let method = Some(format!("{} steps", outcome.steps));
    let meta =
        Meta { title: "Visavis reacts".to_owned(), subtitle: names.join(", "), facts, method, live: out.live_page() };
    let paths = out.write(&outcome.recording, &meta, &summary)?;
    print(&report(&outcome, &sounds, &paths))
}

fn report(outcome: &Outcome, sounds: &[Sound], paths: &[PathBuf]) -> String {
    let mut rows = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        rows.push((if i == 0 { "wrote" } else { "" }, path.display().to_string()));
    }
    rows.push(("open", format!("{} in a browser", paths[0].display())));
    let (frames, seconds) = (outcome.recording.frames.len(), outcome.elapsed.as_secs_f64());
    rows.push(("motion", format!("{frames} frames in {} steps, {seconds:.1} s", outcome.steps)));
    if sounds.len() > 1 {
        let place = format!("the model is told where {} is, the loudest at the head", sounds[outcome.told].name);
        rows.push(("place", place));
    }
    if outcome.clipped > 0 {
        rows.push(("note", format!("{} samples were louder than 1 Pa at an ear and clipped", outcome.clipped)));
    }
    rows.into_iter().map(|(name, value)| format!("{name:<9} {value}\n")).collect()
}
