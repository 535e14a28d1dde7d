//! Bad input on the command line: exit code, one line, and nothing left behind.

use super::cli::{Scratch, fails, names, tone};
use super::common::golden_path;
use std::path::Path;
use visavis::{BundleFile, ErrorKind};
use visavis_tools::contents::Contents;
use visavis_tools::offline::{FILES, OutputFolder};

fn text(path: &Path) -> String {
    path.to_str().expect("a plain path").to_owned()
}

/// Runs `generate` on the tiny bundle into `out` with further arguments; it must fail.
fn generate(code: i32, out: &Path, more: &[&str]) -> String {
    let (model, out) = (text(&golden_path("tiny.safetensors")), text(out));
    let mut args = vec!["generate", "--model", &model, "--out", &out];
    args.extend(more);
    fails(code, &args)
}

#[test]
fn bad_files_leave_nothing_behind() {
    let scratch = Scratch::new("command-files");
    let out = scratch.path("new/out");
    let good = text(&scratch.file("good.wav", tone(16_000, 0.5)));
    let cut = text(&scratch.file("cut.wav", &tone(16_000, 0.5)[..1000]));
    let words = text(&scratch.file("words.csv", "t,x,y,z\n0,here,1.6,2\n"));
    let noise = text(&scratch.file("noise.safetensors", [7; 500]));
    for (args, file, part) in [
        (&["--agent", &cut][..], &cut, "cut off"),
        (&["--agent", &good, "--user", &cut], &cut, "cut off"),
        (&["--agent", &good, "--user-path", &words], &words, "line 2"),
        (&["--agent", "no/such.wav"], &"no/such.wav".to_owned(), "cannot read"),
        (&["--agent", &good, "--model", &noise], &noise, "not a safetensors file"),
    ] {
        // A second --model is wrong usage, so the bundle under test goes alone.
        let message = match args {
            [agent, wav, "--model", model] => {
                fails(1, &["generate", agent, wav, "--model", model, "--out", &text(&out)])
            }
            args => generate(1, &out, args),
        };
        assert!(message.starts_with(&format!("visavis: {file}: ")) && message.contains(part), "{message}");
        assert!(!scratch.path("new").exists(), "folders that were made for nothing are removed");
    }
}

#[test]
fn results_of_an_earlier_run_survive_a_failure() {
    let scratch = Scratch::new("command-earlier");
    let out = scratch.path("out");
    std::fs::create_dir(&out).unwrap();
    for name in FILES {
        std::fs::write(out.join(name), name).unwrap();
    }
    generate(1, &out, &["--user", "no/such.wav"]);
    let mut expected = FILES.to_vec();
    expected.sort_unstable();
    assert_eq!(names(&out), expected);
    assert!(FILES.iter().all(|name| std::fs::read_to_string(out.join(name)).unwrap() == *name));
}

#[test]
fn wrong_usage_is_exit_code_two() {
    let scratch = Scratch::new("command-usage");
    let out = scratch.path("out");
    let wav = text(&scratch.file("good.wav", tone(16_000, 0.2)));
    for (args, part) in [
        (&["--agent", &wav, "--smile", "1"][..], "--smile"),
        (&["--agent", &wav, "--gaze", "1.5"], "from -1 to 1, or off"),
        (&["--agent", &wav, "--gaze", "yes"], "from -1 to 1, or off"),
        (&["--agent", &wav, "--sampler", "midpoint3"], "unknown sampler"),
        (&["--agent", &wav, "--sampler", "euler:0"], "unknown sampler"),
        (&["--agent", &wav, "--guidance", "NaN"], "from 0 to 20"),
        (&["--agent", &wav, "--threads", "3"], "1..=2"),
        (&["--agent", &wav, "--gaze", "-1.5"], "from -1 to 1, or off"),
        (&["--agent", &wav, "--seed", "-1"], "--seed"),
        (&["--agent"], "--agent"),
        (&[], "--agent"),
    ] {
        let message = generate(2, &out, args);
        assert!(message.contains(part), "expected `{part}`: {message}");
    }
    assert!(fails(2, &["dance"]).contains("dance"));
    assert!(!out.exists());
}

#[test]
fn an_unwritable_output_is_found_before_anything_is_read() {
    let scratch = Scratch::new("command-output");
    let file = scratch.file("file", "mine");
    let occupied = scratch.path("occupied");
    std::fs::create_dir_all(occupied.join("motion.glb")).unwrap();
    for (out, named) in [
        (file.clone(), file.clone()),
        (file.join("below"), file.join("below")),
        ("/proc/visavis".into(), "/proc/visavis".into()),
        (occupied.clone(), occupied.join("motion.glb")),
    ] {
        // The input does not exist either; the output is complained about first.
        let message = generate(1, &out, &["--agent", "no/such.wav"]);
        assert!(message.starts_with(&format!("visavis: {}: ", named.display())), "{message}");
        let e = OutputFolder::prepare(&out).unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(named.as_path())));
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    assert_eq!(names(&occupied), ["motion.glb"]);
}

#[test]
fn a_folder_that_was_prepared_in_vain_disappears() {
    let scratch = Scratch::new("command-vain");
    let out = scratch.path("a/b/c");
    let prepared = OutputFolder::prepare(&out).unwrap();
    assert_eq!(names(&out).len(), 1, "only the hidden folder");
    // What somebody else puts there meanwhile is not ours to remove.
    std::fs::write(scratch.path("a/other"), "theirs").unwrap();
    drop(prepared);
    assert_eq!(names(&scratch.path("a")), ["other"]);
}

#[test]
fn options_that_the_bundle_cannot_do_are_errors() {
    let message = fails(1, &["inspect", "no/such.safetensors"]);
    assert!(message.starts_with("visavis: no/such.safetensors: cannot open the bundle"), "{message}");
    let message = fails(1, &["inspect", "Cargo.toml"]);
    assert!(message.starts_with("visavis: Cargo.toml: not a safetensors file"), "{message}");
    assert!(fails(2, &["inspect"]).contains("FILE"));
}

#[test]
fn a_trace_that_cannot_be_written_leaves_nothing() {
    let scratch = Scratch::new("command-trace");
    let model = text(&golden_path("tiny.safetensors"));
    let input = text(&golden_path("tiny-golden.safetensors"));
    let out = text(&scratch.path("no/such/folder/stages.safetensors"));
    let message = fails(1, &["trace", "--model", &model, "--input", &input, "--out", &out]);
    assert!(message.starts_with(&format!("visavis: {out}: ")), "{message}");
    let wrong = text(&scratch.file("wrong.safetensors", "words"));
    let good = text(&scratch.path("stages.safetensors"));
    let message = fails(1, &["trace", "--model", &model, "--input", &wrong, "--out", &good]);
    assert!(message.starts_with(&format!("visavis: {wrong}: ")), "{message}");
    assert_eq!(names(&scratch.path("")), ["wrong.safetensors"]);
}

#[test]
fn a_missing_model_says_where_it_was_looked_for() {
    let scratch = Scratch::new("command-model");
    let wav = text(&scratch.file("good.wav", tone(16_000, 0.2)));
    let out = scratch.path("out");
    let missing = scratch.path("none.safetensors");
    let message = fails(1, &["generate", "--agent", &wav, "--model", &text(&missing), "--out", &text(&out)]);
    assert!(message.starts_with(&format!("visavis: {}: cannot open the bundle", missing.display())), "{message}");
    assert!(!out.exists());
}

#[test]
fn an_unknown_cpu_level_is_an_error() {
    let model = text(&golden_path("tiny.safetensors"));
    let scratch = Scratch::new("command-level");
    let wav = text(&scratch.file("good.wav", tone(16_000, 0.2)));
    let output = super::cli::command()
        .env("VISAVIS_CPU", "abacus")
        .args(["generate", "--agent", &wav, "--model", &model, "--out", &text(&scratch.path("out"))])
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && message.contains("VISAVIS_CPU=abacus"), "{message}");
    assert!(!scratch.path("out").exists());
}

#[test]
fn inspecting_refuses_the_same_containers() {
    let bytes = std::fs::read(super::common::golden_path("tiny.safetensors")).expect("the tiny bundle");
    let contents = |bytes: Vec<u8>| Contents::of(&BundleFile::from_bytes(bytes, "some/bundle"));
    assert!(contents(bytes.clone()).unwrap().to_string().contains("tiny"));
    let e = contents(bytes[..bytes.len() / 2].to_vec()).unwrap_err();
    assert!(e.kind() == ErrorKind::BundleCorrupt && e.to_string().starts_with("some/bundle"), "{e}");
}
