//! The accuracy report, end to end with a few blocks.

#[path = "common/cli.rs"]
mod cli;
#[path = "../../tests/common/mod.rs"]
mod common;

use cli::{Scratch, fails, names, succeeds};
use common::{golden_path, tiny_f32};
use visavis::internals::kernels::Scheme;
use visavis::internals::quant::{Options, quantise};

#[test]
fn a_quick_report_tells_everything() {
    let dir = Scratch::new("report");
    let file = |name: &str, scheme| {
        let options = Options { scheme, smallest: 0, keep: &[], calibration: None, budget: None };
        let path = dir.file(name, quantise(&tiny_f32(), &options).unwrap().bytes);
        path.to_str().unwrap().to_owned()
    };
    let (f16, i8) = (file("f16.safetensors", Scheme::F16), file("i8.safetensors", Scheme::I8));
    let path = |name: &str| dir.path(name).to_str().unwrap().to_owned();
    let (numerics, out) = (path("numerics.json"), path("out"));

    succeeds(&["report", "--reference", &f16, "--candidate", &i8, "--quick", "--numerics-only", &numerics]);
    let evaluation = |name: &str, model: &str, seed: &str| {
        let (file, shape) = (path(name), ["--windows", "2", "--sampler", "single", "--quick", "--motion-only"]);
        succeeds(&[&["eval", "--model", model, "--seed", seed, "--json", &file], &shape[..]].concat());
        file
    };
    let evaluated = [("f16.json", &f16, "0"), ("i8.json", &i8, "0"), ("seed.json", &f16, "1")];
    let [eval_f16, eval_i8, eval_seed] = evaluated.map(|(name, model, seed)| evaluation(name, model, seed));
    let text = succeeds(&[
        "report",
        "--reference",
        &f16,
        "--candidate",
        &i8,
        "--quick",
        "--out",
        &out,
        "--other-machine",
        &numerics,
        "--eval",
        &eval_f16,
        &eval_i8,
        "--eval-other-seed",
        &eval_seed,
    ]);
    assert!(text.contains("mean joint error") && text.contains("report.html"), "{text}");
    assert_eq!(names(&dir.path("out")), ["report.html", "report.json", "report.md"]);

    let read = |name: &str| std::fs::read_to_string(dir.path("out").join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    let candidate = &json["numerics"]["candidates"][0];
    assert_eq!(candidate["blocks"].as_array().unwrap().len(), 4, "two samplers, two conversations");
    let mm = |v: &serde_json::Value| v["mm"]["mean"].as_f64().unwrap();
    for block in candidate["blocks"].as_array().unwrap() {
        assert!(mm(block) > 0.0 && block["mm"]["max"].as_f64().unwrap() >= block["mm"]["p99"].as_f64().unwrap());
    }
    let machines = json["machines"].as_array().unwrap();
    assert_eq!(machines[0], machines[1], "the same machine gives the same numbers");
    let tensors = candidate["tensors"].as_array().unwrap();
    let row = |name: &str| tensors.iter().find(|t| t["name"] == name).unwrap();
    let (run, unread) = (row("flow.layers.0.qkv"), row("vae.encoder.logvar"));
    assert!(run["sqnr_db"].as_f64().unwrap() > 20.0 && run["output"]["cosine"].as_f64().unwrap() > 0.99, "{run}");
    assert_eq!((&run["activation_bits"], &row("vae.decoder.out")["activation_bits"]), (&8.into(), &16.into()));
    assert!(unread["output"].is_null(), "a layer that no block runs has no outputs: {unread}");
    assert_eq!(json["speed"].as_array().unwrap().len(), 2);

    let changed = |v: &serde_json::Value| v[0]["change"].as_f64().unwrap().abs();
    let judged = &json["judged"];
    assert!(changed(&judged["fgd"][0]) > 0.0 && changed(&judged["chance"]) > 0.0, "{judged}");
    let target = json["targets"][0].as_array().unwrap().iter().find(|t| t["what"] == "change of FGD").unwrap();
    assert_eq!(target["measured"].as_f64().unwrap(), changed(&judged["fgd"][0]));

    let (html, md) = (read("report.html"), read("report.md"));
    for part in ["In short", "Targets", "Free-running", "Speed", "Other machines", "Change of FGD", "flow.layers.0.qkv"]
    {
        assert!(html.contains(part) && md.contains(part), "{part}");
    }
    assert!(html.contains("<svg") && !html.contains("http-equiv") && !html.contains("<script"), "pictures, no scripts");

    // An int8 bundle is no reference, and another model is no candidate.
    fails(1, &["report", "--reference", &i8, "--candidate", &f16, "--quick", "--out", &out]);
    fails(1, &["report", "--reference", &f16, "--candidate", "no/such.safetensors", "--quick", "--out", &out]);
    fails(2, &["report", "--reference", &f16, "--candidate", &i8, "--quick"]);
}

/// A pair of the featherweight tier: rows by its kind, errors of the poses, no latents.
#[test]
fn a_pair_without_latents_has_a_report() {
    let dir = Scratch::new("report-dram");
    let (reference, out) = (golden_path("dram-tcn.safetensors"), dir.path("out").to_str().unwrap().to_owned());
    let reference = reference.to_str().unwrap();
    let options = Options { scheme: Scheme::I8, smallest: 0, keep: &[], calibration: None, budget: None };
    let bytes = quantise(&visavis::BundleFile::open(reference).unwrap(), &options).unwrap().bytes;
    let i8 = dir.file("i8.safetensors", bytes).to_str().unwrap().to_owned();
    succeeds(&["report", "--reference", reference, "--candidate", &i8, reference, "--quick", "--out", &out]);
    let read = |name: &str| std::fs::read_to_string(dir.path("out").join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    let [changed, same] = [0, 1].map(|i| &json["numerics"]["candidates"][i]["blocks"]);
    let names: Vec<_> = changed.as_array().unwrap().iter().map(|b| b["sampler"].as_str().unwrap()).collect();
    assert_eq!(names, ["dram", "dram, voices exchanged"]);
    for (b, equal) in changed.as_array().unwrap().iter().zip(same.as_array().unwrap()) {
        assert!((1e-3..50.0).contains(&b["mm"]["mean"].as_f64().unwrap()), "{}", b["mm"]);
        assert!(b["latent_sqnr_db"].as_f64().unwrap() > 10.0 && b["round_trip_mm"].is_null());
        // The reference against itself: every block is begun as it began it.
        assert_eq!(equal["mm"]["max"], 0.0);
        assert_ne!(b["bits"], equal["bits"]);
    }
    let output = &json["numerics"]["candidates"][0]["tensors"][0]["output"];
    assert!(output["rows"].as_u64().unwrap() > 0, "layers are heard: {output}");
    assert_eq!(json["speed"][1]["samplers"][0][0], "dram");
    let md = read("report.md");
    assert!(json["numerics"]["sounds"] == 0 && !md.contains("sounds"), "{md}");
    assert!(md.contains("| dram |") && !md.contains("midpoint") && !md.contains("VAE"), "{md}");
}

/// Bundles that hear are compared while something sounds, and the report says so.
#[test]
fn a_pair_that_hears_is_told_from_one_that_does_not() {
    let dir = Scratch::new("report-hearing");
    let options = |scheme| Options { scheme, smallest: 0, keep: &[], calibration: None, budget: None };
    let file = |name: &str, scheme| {
        let bytes = quantise(&common::hearing_f32(), &options(scheme)).unwrap().bytes;
        dir.file(name, bytes).to_str().unwrap().to_owned()
    };
    let (f16, i8) = (file("f16.safetensors", Scheme::F16), file("i8.safetensors", Scheme::I8));
    let out = dir.path("out").to_str().unwrap().to_owned();
    succeeds(&["report", "--reference", &f16, "--candidate", &i8, "--quick", "--out", &out]);
    let read = |name: &str| std::fs::read_to_string(dir.path("out").join(name)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&read("report.json")).unwrap();
    let sounds = json["numerics"]["sounds"].as_u64().unwrap();
    assert!(sounds > 0);
    assert!(read("report.md").contains(&format!("{sounds} sounds around the agent")));
}
