//! The runtime equals PyTorch, stage by stage: 1e-4 in fp32.
//!
//! The golden file was computed without caches, every token anew at each evaluation, over more than
//! three windows; so these tests also show that the cache of each slot is exact.

mod common;

use common::{Golden, dram, dram_in, max_error, tiny};
use std::collections::BTreeMap;
use std::sync::Arc;
use visavis::internals::config::CleanHistory;
use visavis::internals::kernels::KvDtype;
use visavis::internals::kernels::Scheme;
use visavis::internals::session::{Anchoring, Diagnostics, HistoryTime, Probe};
use visavis::{BLOCK_FRAMES, Engine, FPS, Sampler, SessionOptions};

const TOLERANCE: f32 = 1e-4;

/// Collects stages: for each name, the values of all blocks in order.
#[derive(Default)]
struct Stages(BTreeMap<&'static str, Vec<f32>>);

impl Probe for Stages {
    fn stage(&mut self, _block: u64, name: &'static str, values: &[f32]) {
        self.0.entry(name).or_default().extend_from_slice(values);
    }
}

/// Runs the golden file's inputs and noise through a session.
fn stages(golden: &Golden, sampler: Sampler, cache: KvDtype) -> BTreeMap<&'static str, Vec<f32>> {
    stages_with(golden, sampler, Diagnostics { cache, ..Default::default() })
}

fn stages_with(golden: &Golden, sampler: Sampler, given: Diagnostics) -> BTreeMap<&'static str, Vec<f32>> {
    stages_of(&tiny(), golden, sampler, given)
}

fn stages_of(
    engine: &Arc<Engine>,
    golden: &Golden,
    sampler: Sampler,
    given: Diagnostics,
) -> BTreeMap<&'static str, Vec<f32>> {
    let gaze = Some(golden.values("gaze")[0]);
    let diagnostics = Diagnostics { anchoring: Anchoring::Never, bridge: false, ..given };
    let options = SessionOptions {
        sampler,
        gaze,
        stance: false,
        guard: false,
        sensitivity: 0.5,
        diagnostics,
        ..Default::default()
    };
    let mut session = engine.session(options).expect("session");
    let mut noise = golden.values("eps_idle");
    noise.extend(golden.values("eps"));
    session.reset_with_noise(noise).expect("noise");
    session.push_agent_audio(&golden.values("agent_voice"), 24_000).expect("agent voice");
    session.push_user_audio(&golden.values("user_voice"), 24_000).expect("user voice");
    for (i, p) in golden.values("user_path").chunks_exact(3).enumerate() {
        session.push_user_head(glam::Vec3::from_slice(p), i as f64 / f64::from(FPS)).expect("head");
    }
    // Sounds, where the engine hears any: each before the block that it begins with.
    let begins = if engine.has_hearing() { golden.values("sounds.blocks") } else { Vec::new() };
    let mut stages = Stages::default();
    for block in 0..golden.get("eps").0[0] {
        for (i, _) in begins.iter().enumerate().filter(|(_, begin)| **begin as usize == block) {
            let place = glam::Vec3::from_slice(&golden.values("sounds.places")[3 * i..]);
            session.push_sound(i as u32, &golden.values(&format!("sounds.{i}")), 24_000, place).expect("a sound");
        }
        let now = session.next_due();
        session.poll_with(now, Some(&mut stages)).expect("poll").expect("due");
    }
    stages.0
}

#[test]
fn every_stage_equals_pytorch() {
    let golden = Golden::load();
    let ours = stages(&golden, Sampler::Midpoint4, KvDtype::F32);
    let audio = golden.get("agent_features").0[1];
    // The user's voice is heard a block late: the last block of the golden features is not reached.
    let checks = [
        ("agent_features", golden.values("agent_features")),
        ("user_features", {
            let all = golden.values("user_features");
            all[..all.len() - 4 * audio].to_vec()
        }),
        ("conditioning.user", golden.values("conditioning.user")[8..].to_vec()),
        ("x1", (0..golden.get("eps").0[0]).flat_map(|k| golden.values(&format!("x1.{k}"))).collect()),
        ("latents", golden.values("latents")),
        ("roots", golden.values("roots")),
        ("positions", golden.values("positions")),
    ];
    for (name, expected) in checks {
        let error = max_error(&ours[name], &expected);
        println!("{name}: {error:e}");
        assert!(error < TOLERANCE, "{name} differs by {error}");
    }

    let features = golden.get("decoded").0[1];
    for (row, frame) in golden.values("decoded").chunks_exact(features).zip(golden.values("decoded_frames")) {
        let error = max_error(&ours["decoded"][frame as usize * features..][..features], row);
        assert!(error < TOLERANCE, "decoded frame {frame} differs by {error}");
    }
    for (a, b) in ours["rotations"].chunks_exact(4).zip(golden.values("rotations").chunks_exact(4)) {
        let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        assert!(dot.abs() > 1.0 - 1e-6, "rotation {a:?} is not {b:?}");
    }
}

/// The tiny bundle with hearing, and three sources of which each stands out in its turn.
#[test]
fn hearing_equals_pytorch() {
    let engine = Engine::load(common::golden_path("hearing.safetensors")).expect("the tiny bundle with hearing loads");
    let golden = Golden::named("hearing.out.safetensors");
    let ours =
        stages_of(&engine, &golden, Sampler::Midpoint4, Diagnostics { cache: KvDtype::F32, ..Default::default() });
    let heard = golden.values("conditioning.heard");
    let first = heard.iter().position(|heard| *heard > 0.0).expect("something is heard");
    let (blocks, width) = (golden.get("eps").0[0], golden.get("conditioning.sound").0[1]);
    let features = golden.get("hearing.features").0[1];
    let ears: Vec<f32> = {
        // Frames 8 to 31 of [frame, ear, sample] in the order of blocks.
        let all = golden.values("hearing.ears");
        let frame = |t: usize, ear: usize| &all[(2 * (t - 8) + ear) * 800..][..800];
        let blocks = (2..8).flat_map(|block| [0, 1].map(|ear| (block, ear)));
        blocks.flat_map(|(block, ear)| (4 * block..4 * block + 4).flat_map(move |t| frame(t, ear))).copied().collect()
    };
    assert_eq!(first, 3, "the golden file's first sound begins with block 2");
    let checks = [
        ("hearing.ears", ears),
        ("hearing.features", golden.values("hearing.features")[4 * (first - 1) * features..].to_vec()),
        ("conditioning.sound", golden.values("conditioning.sound")[first * width..].to_vec()),
        ("x1", (0..blocks).flat_map(|k| golden.values(&format!("x1.{k}"))).collect()),
        ("latents", golden.values("latents")),
        ("roots", golden.values("roots")),
        ("positions", golden.values("positions")),
    ];
    for (name, expected) in checks {
        let ours = if name == "hearing.ears" { &ours[name][..expected.len()] } else { &ours[name] };
        let error = max_error(ours, &expected);
        println!("{name}: {error:e}");
        assert!(error < TOLERANCE, "{name} differs by {error}");
    }
    let student =
        stages_of(&engine, &golden, Sampler::Single, Diagnostics { cache: KvDtype::F32, ..Default::default() });
    let error = max_error(&student["latents"], &golden.values("student"));
    assert!(error < TOLERANCE, "the student differs by {error}");
}

/// A bundle that is told how active the body is at rest, and whose late evaluations are conditional
/// alone. The agent speaks at first, the user stands.
#[test]
fn rest_equals_pytorch() {
    let engine = Engine::load(common::golden_path("rest.safetensors")).expect("the tiny bundle with rest loads");
    let golden = Golden::named("rest.out.safetensors");
    let rests = golden.values("rests");
    assert!(rests.contains(&0.0) && rests.contains(&1.0), "the golden file has both");
    for (sampler, name) in [
        (Sampler::Midpoint4, "latents"),
        (Sampler::Midpoint2, "latents.midpoint2"),
        (Sampler::Midpoint1, "latents.midpoint1"),
        (Sampler::Single, "student"),
    ] {
        let ours = stages_of(&engine, &golden, sampler, Diagnostics { cache: KvDtype::F32, ..Default::default() });
        let told = ours["conditioning.activity"].len() / 3;
        assert_eq!(told, rests.iter().filter(|rests| **rests > 0.0).count(), "{sampler}: blocks at rest");
        let error = max_error(&ours["latents"], &golden.values(name));
        println!("{sampler}: {error:e}");
        assert!(error < TOLERANCE, "{sampler} differs by {error}");
    }
}

#[test]
fn cheaper_samplers_equal_pytorch() {
    let golden = Golden::load();
    let cases = [
        (Sampler::Midpoint2, "latents.midpoint2"),
        (Sampler::Midpoint1, "latents.midpoint1"),
        (Sampler::Single, "student"),
    ];
    for (sampler, name) in cases {
        let ours = stages(&golden, sampler, KvDtype::F32);
        let error = max_error(&ours["latents"], &golden.values(name));
        println!("{sampler}: {error:e}");
        assert!(error < TOLERANCE, "{sampler} differs by {error}");
    }
}

/// History at 0.9 or later in evaluations from 0.3 on, at the evaluations' own flow times before.
#[test]
fn clean_history_equals_pytorch() {
    let golden = Golden::load();
    let history = HistoryTime::Clean(CleanHistory { tau: 0.9, from: 0.3 });
    let clean = Diagnostics { cache: KvDtype::F32, history, ..Default::default() };
    let ours = stages_with(&golden, Sampler::Midpoint4, clean);
    let error = max_error(&ours["latents"], &golden.values("latents.clean"));
    println!("clean history: {error:e}");
    assert!(error < TOLERANCE, "latents differ by {error}");
    assert!(max_error(&golden.values("latents.clean"), &golden.values("latents")) > 0.01, "it is another sampler");
}

/// fp16 rounds keys and values to 11 bits (relative 5e-4); over 20 free-running blocks with random
/// weights that stays below 2e-2 of a latent of unit scale.
#[test]
fn fp16_cache_stays_close() {
    let golden = Golden::load();
    let ours = stages(&golden, Sampler::Midpoint4, KvDtype::F16);
    let error = max_error(&ours["latents"], &golden.values("latents"));
    println!("fp16 cache: {error:e}");
    assert!(error > 0.0, "the cache is stored in fp16");
    assert!(error < 2e-2, "latents differ by {error}");
}

/// What a session of the featherweight tier is told of a golden file's inputs.
#[derive(Clone, Copy)]
struct Told {
    voices: bool,
    head: bool,
    rotation: bool,
    gaze: bool,
}

const EVERYTHING: Told = Told { voices: true, head: true, rotation: true, gaze: true };

/// Runs a golden file's inputs through a session of the featherweight tier.
fn steps(engine: &std::sync::Arc<Engine>, golden: &Golden, told: Told) -> BTreeMap<&'static str, Vec<f32>> {
    let gaze = told.gaze.then(|| golden.values("gaze")[0]);
    let diagnostics = Diagnostics { bridge: false, ..Default::default() };
    let options = SessionOptions { gaze, stance: false, guard: false, diagnostics, ..Default::default() };
    let mut session = engine.session(options).expect("session");
    if told.voices {
        session.push_agent_audio(&golden.values("agent_voice"), 24_000).expect("agent voice");
        session.push_user_audio(&golden.values("user_voice"), 24_000).expect("user voice");
    }
    let (path, rotations) = (golden.values("user_path"), golden.values("user_rotation"));
    for (i, (p, r)) in path.chunks_exact(3).zip(rotations.chunks_exact(4)).enumerate().filter(|_| told.head) {
        let rotation = told.rotation.then(|| glam::Quat::from_slice(r));
        session.push_user_pose(glam::Vec3::from_slice(p), rotation, i as f64 / f64::from(FPS)).expect("head");
    }
    let mut stages = Stages::default();
    for _ in 0..golden.get("user_path").0[0] / BLOCK_FRAMES {
        let now = session.next_due();
        let frames = session.poll_with(now, Some(&mut stages)).expect("poll").expect("due");
        assert!(frames.iter().all(|frame| frame.dyadic.len() == frame.global.len()));
    }
    stages.0
}

#[test]
fn every_step_of_the_featherweight_tier_equals_pytorch() {
    for backbone in ["tcn", "lstm"] {
        let (engine, golden) = (dram(backbone), Golden::named(&format!("dram-{backbone}.out.safetensors")));
        let ours = steps(&engine, &golden, EVERYTHING);
        for name in ["agent_features", "user_rows", "m", "d", "delta", "poses", "dyadic", "roots", "positions"] {
            let error = max_error(&ours[name], &golden.values(name));
            println!("{backbone}, {name}: {error:e}");
            assert!(error < TOLERANCE, "{backbone}: {name} differs by {error}");
        }
        for (a, b) in ours["rotations"].chunks_exact(4).zip(golden.values("rotations").chunks_exact(4)) {
            let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            assert!(dot.abs() > 1.0 - 1e-6, "{backbone}: rotation {a:?} is not {b:?}");
        }
        let nothing = Told { voices: false, head: false, rotation: false, gaze: false };
        let position = Told { rotation: false, gaze: false, ..EVERYTHING };
        let full = golden.values("poses");
        for (told, name) in [(nothing, "absent.poses"), (position, "position.poses")] {
            let (ours, golden) = (steps(&engine, &golden, told), golden.values(name));
            let error = max_error(&ours["poses"], &golden);
            println!("{backbone}, {name}: {error:e}");
            assert!(error < TOLERANCE, "{backbone}: {name} differs by {error}");
            assert!(max_error(&golden, &full) > 1e-3, "{backbone}: what is told changes the motion");
        }
    }
}

/// The first step alone: what integers make of one forecast, before it feeds on itself.
#[test]
fn quantised_steps_stay_close() {
    for (backbone, scheme, most) in
        ["tcn", "lstm"].into_iter().flat_map(|b| [(b, Scheme::F16, 1e-2), (b, Scheme::I8, 5e-2)])
    {
        let golden = Golden::named(&format!("dram-{backbone}.out.safetensors"));
        let ours = steps(&dram_in(backbone, scheme), &golden, EVERYTHING);
        for name in ["m", "d", "delta"] {
            let golden = golden.values(name);
            let size = golden.len() / golden_frames(&ours);
            let error = max_error(&ours[name][..size], &golden[..size]);
            println!("{backbone} {scheme}, {name}: {error:e}");
            assert!(error < most, "{backbone} {scheme}: {name} differs by {error}");
        }
    }
}

fn golden_frames(ours: &BTreeMap<&'static str, Vec<f32>>) -> usize {
    ours["roots"].len() / 3
}
