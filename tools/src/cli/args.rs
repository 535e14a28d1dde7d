//! Arguments.

use super::quantize::QuantizeArgs;
use super::report::ReportArgs;
use super::values::{Gaze, GuidanceArgs, gaze, sensitivity};
use clap::builder::RangedU64ValueParser;
use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;
use visavis::{Engine, Sampler, SessionOptions};

/// A body for a virtual agent: hears both voices, sees the user's head, moves at 30 frames per
/// second.
///
/// Without a command it runs the demo. VISAVIS_CPU=LEVEL forces the kernels of a CPU level (scalar,
/// avx2, ...).
#[derive(Debug, Parser)]
#[command(name = "visavis", version)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Runs the shipped model over the bundled sample conversation
    Demo(DemoArgs),
    /// Generates motion for your own voices and path
    Generate(GenerateArgs),
    /// Tells what a bundle holds: networks, sizes, rig, delays, licence
    Inspect(InspectArgs),
    /// Quantises a bundle of floats to int8, int4 or half floats
    Quantize(QuantizeArgs),
    /// Reports what quantised bundles lose and what they cost
    Report(ReportArgs),
    /// Measures how fast a bundle, or a network of a size, runs here, and where the time goes
    Bench(super::bench::BenchArgs),
    /// Judges a bundle on recorded conversations: motion, gaze, reaction, endurance, against
    /// targets
    Eval(super::eval::EvalArgs),
    /// Measures what a bundle's gaze channel does, so that gaze targets are what they say
    Calibrate(super::calibrate::CalibrateArgs),
    /// Drives a session through hours of motion and judges memory, allocations, drift and precision
    Soak(super::soak::SoakArgs),
    /// Serves the live page on this machine: meet the agent in a browser
    Live(super::live::LiveArgs),
    /// Reacts to sounds around the agent, eight seconds at a time (bundles of the kind mospa)
    React(super::react::ReactArgs),
    /// Tells where what two microphones hear comes from, as a session takes it to be
    Locate(LocateArgs),
    /// Runs given conditioning and noise through a bundle and writes every stage
    Trace(TraceArgs),
}

#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// How much the agent looks at the user, -1 to 1: 0 is averted, 1 sustained eye contact; or off
    /// for what comes naturally
    #[arg(long, value_name = "-1..1|off", value_parser = gaze, default_value = "off", allow_negative_numbers = true)]
    pub gaze: Gaze,
    /// midpoint4, midpoint2, midpoint1, euler:N or single
    #[arg(long, value_name = "NAME", default_value = "midpoint4")]
    pub sampler: Sampler,
    #[command(flatten)]
    pub weights: GuidanceArgs,
    /// How readily the agent reacts to sounds: dull, neutral, sensitive, or a number from -1.5
    /// (dull is -1) to 1.5
    #[arg(long, value_name = "NAME", value_parser = sensitivity, default_value = "neutral", allow_negative_numbers = true)]
    pub sensitivity: f32,
    /// Bundle [default: the shipped one, in models/ here, beside the program, or in its source
    /// folder]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
    /// Seed of the noise: same seed and inputs, same motion
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u64,
    /// Threads, 1 or 2; the motion is the same
    #[arg(long, value_name = "N", default_value = "1", value_parser = RangedU64ValueParser::<usize>::new().range(1..=2))]
    pub threads: usize,
}

#[derive(Debug, Clone, Args)]
pub struct DemoArgs {
    #[command(flatten)]
    pub run: RunArgs,
    /// A dog, a crash behind the agent and music interrupt; needs a bundle with hearing [default:
    /// models/visavis-room-i8.safetensors]
    #[arg(long)]
    pub sounds: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    pub out: PathBuf,
}

#[derive(Debug, Clone, Args)]
#[group(id = "inputs", required = true, multiple = true, args = ["agent", "user", "user_path", "sound", "ears"])]
pub struct GenerateArgs {
    /// The agent's voice: WAV, 8 to 192 kHz, int or float, mono or more; left out, it is absent
    #[arg(long, value_name = "WAV")]
    pub agent: Option<PathBuf>,
    /// The user's voice, likewise
    #[arg(long, value_name = "WAV")]
    pub user: Option<PathBuf>,
    /// Path of the user's head: CSV with the header t,x,y,z; seconds and metres, any rate. The
    /// agent starts at the origin of that world, on the floor y = 0, facing +z
    #[arg(long, value_name = "CSV")]
    pub user_path: Option<PathBuf>,
    /// A sound in the room, for bundles with hearing: WAV file, where it is (metres, in that world,
    /// +x is the agent's left at the start), when it begins (seconds), its source's number (each
    /// sound is a source of its own), and how loud its loudest 125 ms are at 1 m (dB SPL; left out,
    /// full scale is 1 pascal). As many as you like; sixteen sources sound at once
    #[arg(long, value_name = "WAV@X,Y,Z[:t=S][:id=N][:db=L]")]
    pub sound: Vec<String>,
    /// What two microphones at the agent's ears hear, for bundles with hearing: stereo WAV, the
    /// left one first, full scale 1 pascal, and when it begins (seconds). Where it comes from is
    /// estimated
    #[arg(long, value_name = "WAV[:t=S]")]
    pub ears: Option<String>,
    #[command(flatten)]
    pub run: RunArgs,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/generate")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
pub struct LocateArgs {
    /// Stereo WAV, the left ear first, full scale 1 pascal, and when it begins (seconds)
    #[arg(value_name = "WAV[:t=S]")]
    pub ears: String,
    /// How the head turns: CSV with the header t,yaw, seconds and degrees, 0 is +z and 90 +x, to
    /// which azimuths are told too; left out, it stays at 0
    #[arg(long, value_name = "CSV")]
    pub turns: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct InspectArgs {
    /// Bundle
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Prints JSON: bytes, the whole config, every tensor
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct TraceArgs {
    /// Bundle
    #[arg(long, value_name = "FILE")]
    pub model: PathBuf,
    /// Conditioning and noise, safetensors: agent_voice, user_voice `[N]` at 24 kHz; user_path
    /// `[T,3]`; gaze `[1]`; eps `[K,Dz]` with eps_idle `[M,Dz]`. Each may be left out
    #[arg(long, value_name = "FILE")]
    pub input: PathBuf,
    /// Where the stages go, safetensors
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// midpoint4, midpoint2, midpoint1, euler:N or single
    #[arg(long, value_name = "NAME", default_value = "midpoint4")]
    pub sampler: Sampler,
    #[command(flatten)]
    pub weights: GuidanceArgs,
    /// Seed of the noise where the input gives none
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub seed: u64,
}

impl Default for DemoArgs {
    /// As `visavis demo` without options.
    fn default() -> Self {
        match Cli::parse_from(["visavis", "demo"]).command {
            Some(Command::Demo(args)) => args,
            _ => unreachable!("those are the arguments of the demo"),
        }
    }
}

impl RunArgs {
    /// Options of the session.
    pub fn options(&self) -> SessionOptions {
        SessionOptions {
            seed: self.seed,
            threads: self.threads,
            sampler: self.sampler,
            gaze: self.gaze.0,
            guidance: self.weights.guidance,
            gaze_guidance: self.weights.gaze_guidance,
            sensitivity: self.sensitivity,
            ..SessionOptions::default()
        }
    }

    /// What was chosen and what the bundle chose, as names and values for people.
    pub fn facts(&self, engine: &Engine) -> Vec<(String, String)> {
        let config = engine.config();
        let defaults = &config.session;
        let gaze = self.gaze.0.map_or_else(|| "free".to_owned(), |g| g.to_string());
        let mut facts = vec![
            ("model", config.name.clone()),
            ("about the model", config.description.clone()),
            ("gaze target", gaze),
        ];
        if engine.needs_sarah().is_ok() {
            facts.extend([
                ("sampler", self.sampler.to_string()),
                ("guidance", self.weights.guidance.unwrap_or(defaults.guidance).to_string()),
                ("gaze guidance", self.weights.gaze_guidance.unwrap_or(defaults.gaze_guidance).to_string()),
                ("seed", self.seed.to_string()),
            ]);
        } else {
            facts.push(("generator", format!("{}, a step a frame", engine.kind())));
        }
        if engine.has_hearing() {
            facts.push(("sensitivity", self.sensitivity.to_string()));
        }
        facts.extend([
            ("kernels", engine.kernels().level().to_string()),
            ("made by", format!("visavis {}", env!("CARGO_PKG_VERSION"))),
            ("licence of the model", config.licence.clone()),
        ]);
        facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
        assert_eq!(DemoArgs::default().out, PathBuf::from("out/demo"));
        assert_eq!(DemoArgs::default().run.options(), SessionOptions::default());
    }
}
