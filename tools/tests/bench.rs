//! `visavis bench` from outside: every figure is there. How large they are, is nobody's promise.

#[path = "common/cli.rs"]
mod cli;

use cli::{Scratch, command, fails, names, succeeds};

const TINY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors");

#[test]
fn text_names_every_figure() {
    let text = succeeds(&["bench", "--model", TINY, "--blocks", "4", "--sampler", "single", "--threads", "1"]);
    for part in [
        "kernels",
        "matmul_i8dx_i8cx",
        "loaded in",
        "frames/s",
        "x real time",
        "p50",
        "p95",
        "p99",
        "audio",
        "decoder",
        "GB/s",
        "a reading loop",
        "resident",
        "0 allocations",
        "first frame",
        "cold start, single, 1 thread:",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    fails(2, &["bench", "--model", TINY, "--size", "base"]);
}

#[test]
fn beside_other_work_one_and_two_threads_are_compared() {
    let load = ["bench", "--model", TINY, "--blocks", "4", "--sampler", "single", "--load", "0,2"];
    let text = succeeds(&load);
    for part in ["beside 0 busy threads", "beside 2 busy threads", "1 thread", "2 threads", "2 to 1", "mean", "p99"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json = succeeds(&[&load[..], &["--every", "2", "--json"]].concat());
    for part in ["under_load", "block_ms", "\"every_ms\": 2.0"] {
        assert!(json.contains(part), "{part}: {json}");
    }
    fails(2, &["bench", "--model", TINY, "--every", "2"]);
    fails(2, &[&load[..], &["--threads", "1"]].concat());
}

/// The cold start of seeded weights: a bundle of them is written, loaded by processes of their own,
/// and removed.
#[test]
fn seeded_sizes_start_from_a_file() {
    let dir = Scratch::new("bench");
    let flags = ["--blocks", "1", "--sampler", "single", "--threads", "1", "--networks", "lean", "--json"];
    let run = |size: &[&str]| -> serde_json::Value {
        let all = [&["bench"], size, &flags].concat();
        let output = command().args(all).env("TMPDIR", dir.path("")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    for scheme in ["f16", "i8", "i4"] {
        let json = run(&["--size", "base", "--scheme", scheme]);
        let cold = &json["cold_start"][0];
        assert!(cold["first_frame_ms"].as_f64().unwrap() > 0.0, "{scheme}: {json}");
        assert_eq!(cold["blocks"], 48, "as many as the window holds");
        assert!(names(&dir.path("")).is_empty(), "nothing stays");
    }
    let without = run(&["--model", TINY, "--no-cold-start"]);
    assert_eq!(without["cold_start"].as_array().unwrap().len(), 0);
}
