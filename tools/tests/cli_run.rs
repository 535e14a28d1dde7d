//! `visavis demo` and `visavis generate`, run as programs.

#[path = "common/cli.rs"]
mod cli;

use cli::{Scratch, names, succeeds, tone, visavis};
use std::path::Path;

const TINY: &str = "tests/goldens/tiny.safetensors";
const FILES: [&str; 5] = ["index.html", "metrics.json", "motion.bvh", "motion.glb", "motion.vrma"];

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn metrics(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(out.join("metrics.json")).expect("metrics")).expect("JSON")
}

/// Bytes of the motion that `generate` makes with these arguments.
fn motion(scratch: &Scratch, name: &str, args: &[&str]) -> Vec<u8> {
    let out = scratch.path(name);
    let mut all = vec!["generate", "--model", TINY, "--out", text(&out)];
    all.extend(args);
    succeeds(&all);
    std::fs::read(out.join("motion.bvh")).expect("motion")
}

#[test]
fn the_demo_writes_everything_and_reports() {
    let scratch = Scratch::new("run-demo");
    let out = scratch.path("demo");
    let report = succeeds(&["demo", "--model", TINY, "--out", text(&out)]);
    assert_eq!(names(&out), FILES, "no hidden folder stays");
    for name in FILES {
        assert!(report.contains(text(&out.join(name))), "{report}");
        assert!(std::fs::metadata(out.join(name)).unwrap().len() > 300, "{name}");
    }
    for word in ["frames/s", "x real time", "mean score", "midpoint4, 1 thread", "kernels", "p95"] {
        assert!(report.contains(word), "expected `{word}`: {report}");
    }
    let metrics = metrics(&out);
    let seconds = metrics["seconds"].as_f64().unwrap();
    assert!((25.0..40.0).contains(&seconds), "about half a minute: {seconds}");
    assert!(metrics["head_angle"].is_f64() && metrics["speaking"]["share"].is_f64(), "{metrics}");
}

#[test]
fn same_seed_same_files_and_other_seeds_differ() {
    let scratch = Scratch::new("run-seed");
    let agent = scratch.file("agent.wav", tone(22_050, 1.5));
    let path = scratch.file("user.csv", "t,x,y,z\n0,0,1.6,2\n0.5,0.5,1.6,2\n1,1,1.6,1.5\n");
    let inputs = ["--agent", text(&agent), "--user-path", text(&path), "--gaze", "0.8"];
    let with = |name: &str, more: &[&str]| motion(&scratch, name, &[&inputs[..], more].concat());
    let first = with("first", &["--seed", "5"]);
    assert_eq!(first, with("again", &["--seed", "5"]));
    assert_eq!(first, with("threads", &["--seed", "5", "--threads", "2"]));
    // Into the same folder: the new results replace the old.
    let other = with("first", &["--seed", "6"]);
    assert_ne!(first, other);
    assert_eq!(names(&scratch.path("first")), FILES);
    for more in [&["--gaze", "0"][..], &["--guidance", "3"], &["--gaze-guidance", "5"], &["--sampler", "euler:3"]] {
        let inputs = ["--agent", text(&agent), "--user-path", text(&path), "--seed", "5"];
        let gaze: &[&str] = if more[0] == "--gaze" { &[] } else { &["--gaze", "0.8"] };
        assert_ne!(first, motion(&scratch, "other", &[&inputs[..], gaze, more].concat()), "{more:?}");
    }
}

#[test]
fn either_voice_may_be_missing() {
    let scratch = Scratch::new("run-missing");
    let voice = scratch.file("voice.wav", tone(48_000, 1.0));
    let silence = scratch.file("silence.wav", cli::wav(48_000, &[0.0; 48_000]));
    let path = scratch.file("user.csv", "t,x,y,z\n0,0,1.6,2\n0.5,0.5,1.6,2\n0.7,0.6,1.6,2\n");
    let agent = motion(&scratch, "agent", &["--agent", text(&voice)]);
    let user = motion(&scratch, "user", &["--user", text(&voice)]);
    assert_ne!(agent, user);
    // Absent is not silent.
    assert_ne!(agent, motion(&scratch, "silent", &["--agent", text(&voice), "--user", text(&silence)]));
    let path_only = motion(&scratch, "path", &["--user-path", text(&path)]);
    assert_eq!(metrics(&scratch.path("path"))["frames"], 21);
    assert!(metrics(&scratch.path("agent"))["head_angle"].is_null(), "the user was never seen");
    assert_eq!(metrics(&scratch.path("user"))["frames"], 30);
    assert_ne!(path_only, user);
}

#[test]
fn every_sampler_runs() {
    let scratch = Scratch::new("run-samplers");
    let voice = scratch.file("voice.wav", tone(24_000, 0.5));
    let mut seen = Vec::new();
    for sampler in ["midpoint4", "midpoint2", "midpoint1", "euler:1", "euler:5", "single"] {
        let motion = motion(&scratch, "out", &["--agent", text(&voice), "--sampler", sampler]);
        assert!(!seen.contains(&motion), "{sampler} moves as another does");
        seen.push(motion);
    }
}

#[test]
fn progress_is_plain_lines_where_there_is_no_terminal() {
    let scratch = Scratch::new("run-progress");
    let voice = scratch.file("voice.wav", tone(24_000, 2.0));
    let out = scratch.path("out");
    let output = visavis(&["generate", "--model", TINY, "--agent", text(&voice), "--out", text(&out)]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.lines().all(|line| line.contains(" of 2.0 s, ")) && stderr.lines().count() == 5, "{stderr}");
    assert!(!stderr.contains('\r') && !stderr.contains('\x1b'), "{stderr:?}");
}

#[test]
fn help_tells_the_commands() {
    let help = succeeds(&["--help"]);
    for word in ["demo", "generate", "inspect", "trace"] {
        assert!(help.contains(word), "{help}");
    }
    let help = succeeds(&["generate", "--help"]);
    for word in
        ["--agent", "--user-path", "--gaze", "--sampler", "--guidance", "--gaze-guidance", "--seed", "--threads"]
    {
        assert!(help.contains(word), "{help}");
    }
    assert_eq!(succeeds(&["--version"]).trim(), format!("visavis {}", env!("CARGO_PKG_VERSION")));
}
