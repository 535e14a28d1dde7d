//! `visavis inspect` and `visavis trace`, run as programs.

#[path = "common/cli.rs"]
mod cli;
#[path = "../../tests/common/mod.rs"]
mod common;

use cli::{Scratch, names, succeeds};
use common::{Golden, max_error};
use safetensors::SafeTensors;

const TINY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors");
const GOLDEN: &str = "tests/goldens/tiny-golden.safetensors";

#[test]
fn inspect_tells_what_a_bundle_holds() {
    let text = succeeds(&["inspect", TINY]);
    for word in [
        "tiny",
        "flow transformer",
        "VAE decoder",
        "audio encoder",
        "single-step student",
        "22 joints: hips spine",
        "delays",
        "licence",
        "f16",
    ] {
        assert!(text.contains(word), "expected `{word}`: {text}");
    }
}

#[test]
fn inspect_prints_json_for_programs() {
    let json: serde_json::Value = serde_json::from_str(&succeeds(&["inspect", TINY, "--json"])).expect("JSON");
    assert_eq!(json["config"]["format"], 1);
    assert_eq!(json["config"]["rig"]["joints"][0]["name"], "hips");
    assert_eq!(json["bytes"], std::fs::metadata(TINY).unwrap().len());
    let tensors = json["tensors"].as_array().unwrap();
    let total: u64 = tensors.iter().map(|t| t["bytes"].as_u64().unwrap()).sum();
    assert!(total > 0 && total < json["bytes"].as_u64().unwrap());
    assert!(tensors.iter().any(|t| t["name"] == "flow.input.weight" && t["shape"].as_array().unwrap().len() == 2));
}

/// The trace of the golden file's inputs holds what PyTorch computed.
#[test]
fn trace_equals_pytorch() {
    let scratch = Scratch::new("files-trace");
    let out = scratch.path("stages.safetensors");
    let text = succeeds(&["trace", "--model", TINY, "--input", GOLDEN, "--out", out.to_str().unwrap()]);
    assert!(text.contains("20 blocks"), "{text}");
    assert_eq!(names(&scratch.path("")), ["stages.safetensors"]);

    let bytes = std::fs::read(&out).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let golden = Golden::load();
    let read = |name: &str| {
        let view = file.tensor(name).unwrap_or_else(|_| panic!("no {name}"));
        let values: Vec<_> = view.data().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        (view.shape().to_vec(), values)
    };
    let stages =
        ["conditioning.user", "conditioning.flags", "x1.0", "x1.19", "latents", "agent_features", "roots", "positions"];
    for name in stages {
        let ((shape, ours), (expected_shape, expected)) = (read(name), golden.get(name));
        assert_eq!(shape, expected_shape, "{name}");
        assert!(max_error(&ours, &expected) < 1e-4, "{name} differs by {}", max_error(&ours, &expected));
    }
    assert_eq!(read("rotations").0, golden.get("rotations").0);
    assert_eq!(read("decoded").0, [80, golden.get("decoded").0[1]]);
    // Heard one block late, so the last four frames are missing.
    let (shape, ours) = read("user_features");
    assert_eq!(shape[0], 76);
    assert!(max_error(&ours, &golden.values("user_features")[..ours.len()]) < 1e-4);
}

#[test]
fn trace_draws_noise_from_the_seed_where_none_is_given() {
    let scratch = Scratch::new("files-seed");
    let path: Vec<u8> = (0..24).flat_map(|i| (i as f32 * 0.1).to_le_bytes()).collect();
    let view = safetensors::tensor::TensorView::new(safetensors::Dtype::F32, vec![8, 3], &path).unwrap();
    let input = scratch.file("in.safetensors", safetensors::serialize([("user_path", view)], None).unwrap());
    let run = |name: &str, seed: &str| {
        let out = scratch.path(name);
        let (input, out) = (input.to_str().unwrap(), out.to_str().unwrap());
        succeeds(&["trace", "--model", TINY, "--input", input, "--out", out, "--seed", seed, "--sampler", "single"]);
        std::fs::read(out).unwrap()
    };
    let first = run("a", "1");
    assert_eq!(first, run("b", "1"));
    assert_ne!(first, run("c", "2"));
    let file = SafeTensors::deserialize(&first).unwrap();
    assert_eq!(file.tensor("x1.1").unwrap().shape()[0], 1, "one evaluation");
    assert_eq!(file.tensor("latents").unwrap().shape()[0], 2);
    assert!(file.tensor("agent_features").is_err(), "there was no voice");
}

#[test]
fn eval_judges_a_bundle_and_writes_reports() {
    let scratch = Scratch::new("files-eval");
    let (json, md) = (scratch.path("eval.json"), scratch.path("eval.md"));
    let (j, m) = (json.to_str().unwrap(), md.to_str().unwrap());
    let args =
        ["eval", "--model", TINY, "--quick", "--windows", "1", "--sampler", "single", "--threads", "1"].into_iter();
    let text = succeeds(&args.chain(["--json", j, "--md", m]).collect::<Vec<_>>());
    for word in ["corpus", "single, gaze 0.5", "Targets", "missed", "quick look"] {
        assert!(text.contains(word), "expected `{word}`: {text}");
    }
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!(report["windows"][0], 1);
    assert!(report["rows"][0]["all"]["foot_slide"].is_number());
    assert!(std::fs::read_to_string(&md).unwrap().contains("| single |"));

    let wrong = scratch.file("clip.safetensors", b"not a clip, but long enough for a header");
    let said = cli::fails(1, &["eval", "--model", TINY, "--clips", wrong.to_str().unwrap()]);
    assert!(said.contains("clip.safetensors"), "{said}");
}

#[test]
fn eval_keeps_motion_and_judges_what_others_made() {
    let scratch = Scratch::new("files-keep");
    let kept = scratch.path("kept");
    fn with<'a>(args: &[&'a str]) -> Vec<&'a str> {
        let eval = ["eval", "--model", TINY, "--quick", "--motion-only", "--windows", "1", "--sampler", "single"];
        [&eval[..], args].concat()
    }
    succeeds(&with(&["--keep", kept.to_str().unwrap()]));
    assert!(kept.join("corpus/000.safetensors").is_file() && kept.join("VAE/000.safetensors").is_file());

    let row = |name: &str, folder: &str| format!("{name}={}", kept.join(folder).display());
    let (mine, truth) = (row("mine", "single"), row("truth", "corpus"));
    let text = succeeds(&with(&["--row", &mine, "--row", &truth]));
    let figures = |row: &str| {
        let line = text.lines().find(|line| line.starts_with(&format!("{row} "))).unwrap_or_else(|| panic!("{text}"));
        line.trim_start_matches(row).trim().to_owned()
    };
    assert_eq!(figures("mine"), figures("single"));
    assert_eq!(figures("truth"), figures("corpus"));

    let said = cli::fails(1, &with(&["--row", &row("mine", "nothing")]));
    assert!(said.contains("no such folder"), "{said}");
    let said = cli::fails(1, &with(&["--keep", kept.to_str().unwrap()]));
    assert!(said.contains("empty it"), "{said}");
    assert!(cli::fails(2, &with(&["--row", "mine"])).contains("NAME=DIR"));
}
