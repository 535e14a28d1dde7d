//! `visavis generate`: files in, a folder of results out.

use super::args::{GenerateArgs, RunArgs};
use super::progress::ProgressLine;
use super::{files, print};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use visavis::stats::SessionStats;
use visavis::{Engine, Result};
use visavis_tools::export::viewer::Meta;
use visavis_tools::metrics::Summary;
use visavis_tools::offline::{self, Conversation, Ears, Outcome, OutputFolder, Sound};

pub fn run(args: &GenerateArgs) -> Result<()> {
    let out = OutputFolder::prepare(&args.out)?;
    let inputs = [&args.agent, &args.user, &args.user_path].map(|file| file.as_deref());
    let sounds = args.sound.iter().map(|text| Sound::read(text)).collect::<Result<Vec<_>>>()?;
    let ears = args.ears.as_deref().map(Ears::read).transpose()?;
    let titles: Vec<_> =
        sounds.iter().map(|sound| &sound.name).chain(ears.as_ref().map(|ears| &ears.name)).cloned().collect();
    let talk = Conversation::read_with(inputs[0], inputs[1], inputs[2], sounds, ears)?;
    let name = |file: &Path| Some(file.file_name()?.to_string_lossy().into_owned());
    let names: Vec<_> = inputs.into_iter().flatten().filter_map(name).chain(titles).collect();
    generate(&args.run, &talk, "Visavis", &names.join(", "), out)
}

/// Loads the model, runs the conversation, writes `out` and reports.
pub fn generate(args: &RunArgs, talk: &Conversation, title: &str, subtitle: &str, out: OutputFolder) -> Result<()> {
    let model = files::model(args.model.as_deref())?;
    let engine = Engine::load(&model)?;
    if talk.has_sounds() {
        files::hears(&engine, &model)?;
    }
    let mut session = engine.session(args.options())?;
    let mut line = ProgressLine::new();
    let outcome = offline::run(&mut session, talk, &mut |progress| line.show(progress))?;
    line.finish();
    let summary = Summary::of(&outcome.recording);
    let live = out.live_page();
    let meta =
        Meta { title: title.to_owned(), subtitle: subtitle.to_owned(), facts: args.facts(&engine), method: None, live };
    let paths = out.write(&outcome.recording, &meta, &summary)?;
    print(&report(args, &engine, &outcome, &summary, &paths))
}

fn report(args: &RunArgs, engine: &Engine, outcome: &Outcome, summary: &Summary, paths: &[PathBuf]) -> String {
    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<9} {value}");
    };
    for (i, path) in paths.iter().enumerate() {
        row(if i == 0 { "wrote" } else { "" }, path.display().to_string());
    }
    row("open", format!("{} in a browser", paths[0].display()));
    let (frames, seconds) = (summary.frames, summary.seconds);
    row(
        "speed",
        format!(
            "{:.0} frames/s, {:.1} x real time ({frames} frames, {seconds:.1} s of motion in {:.1} s)",
            outcome.frames_per_second(),
            outcome.real_time_factor(),
            outcome.elapsed.as_secs_f64()
        ),
    );
    let [p50, p95, p99, max] = outcome.stats.block_ms;
    row("block", format!("p50 {p50:.1}, p95 {p95:.1}, p99 {p99:.1}, max {max:.1} ms of 133.3 ms"));
    row(
        "gaze",
        match (summary.head_angle, args.gaze.0) {
            (None, _) => "no score: the user is not seen".to_owned(),
            (Some(score), None) => format!("mean score {score:.2}"),
            (Some(score), Some(target)) => format!("mean score {score:.2}, target {target}"),
        },
    );
    let threads = if args.threads == 1 { "1 thread".to_owned() } else { format!("{} threads", args.threads) };
    match &summary.dyadic {
        Some(dyadic) => {
            row("follows", format!("the user {:.0} %, the agent's own voice and habit the rest", 100.0 * dyadic.mean));
            row("made by", format!("{}, a step a frame, {threads}", engine.kind()));
        }
        None => row("sampler", format!("{}, {threads}", args.sampler)),
    }
    let kernels = engine.kernels();
    row("kernels", format!("{} ({})", kernels.level(), variants(&kernels.variants())));
    for note in notes(&outcome.stats) {
        row("note", note);
    }
    text
}

/// Variants with the operations that run them, each variant once.
fn variants(all: &[(&str, &str)]) -> String {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for &(operation, variant) in all {
        match groups.iter_mut().find(|(name, _)| *name == variant) {
            Some((_, operations)) => operations.push(operation),
            None => groups.push((variant, vec![operation])),
        }
    }
    let groups: Vec<_> =
        groups.into_iter().map(|(name, operations)| format!("{name}: {}", operations.join(" "))).collect();
    groups.join("; ")
}

/// What was odd about the inputs.
fn notes(stats: &SessionStats) -> Vec<String> {
    let inputs = &stats.inputs;
    let sounds = &inputs.sounds;
    let counts = [
        (sounds.clipped_samples, "samples of sounds were louder than 64 pascals and clipped"),
        (sounds.refused + sounds.replaced, "sources were dropped: sixteen sound at once, the loudest at the head"),
        (inputs.agent_voice.clipped_samples, "samples of the agent's voice were far beyond full scale and clipped"),
        (inputs.user_voice.clipped_samples, "samples of the user's voice were far beyond full scale and clipped"),
        (inputs.head.teleports, "times the user's head moved faster than anybody can; the way between was left out"),
    ];
    counts.into_iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn variants_are_named_once() {
        let all = [("matmul", "avx2"), ("norm", "scalar"), ("rope", "avx2")];
        assert_eq!(super::variants(&all), "avx2: matmul rope; scalar: norm");
    }
}
