//! The evaluation knows good from bad, and does not depend on threads.

use super::*;
use crate::offline::Conversation;
use crate::offline::UserPath;
use glam::Vec3;
use visavis::internals::config::{Config, RestConfig};

/// Half a minute of two voices that take turns, and a user who goes round the agent.
pub(super) fn talk() -> Conversation {
    let voice = |turn: f32, pitch: f32| -> Vec<f32> {
        let sample = |i: usize| {
            let t = i as f32 / 24_000.0;
            let speaks = (t / 3.0 + turn).rem_euclid(2.0) < 1.2;
            let level = (20.0 * t + (1.7 * t).sin()).sin().max(0.0);
            if speaks { 0.3 * level * (pitch * t).sin() } else { 0.0 }
        };
        (0..24_000 * 32).map(sample).collect()
    };
    let path = (0..32 * 30).map(|i| {
        let a = 0.05 * i as f32 / 30.0;
        (f64::from(i) / 30.0, Vec3::new(1.6 * a.sin(), 1.65, 1.6 * a.cos()))
    });
    let path = UserPath::from_points(path.collect()).unwrap();
    Conversation::new(Some(voice(0.0, 800.0)), Some(voice(1.0, 1200.0)), Some(path)).unwrap()
}

pub(super) fn tiny() -> Arc<Engine> {
    Engine::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors")).unwrap()
}

fn quick(threads: usize) -> Report {
    let engine = tiny();
    let samplers = vec![Sampler::Midpoint1, Sampler::Single];
    let options = EvalOptions { windows: 4, threads, samplers, quick: true, ..EvalOptions::default() };
    evaluate(&engine, &synthetic(&engine.config().rig, &talk()), None, &options, &|_| {}).unwrap()
}

#[test]
fn a_report_is_whole_and_the_same_on_any_number_of_threads() {
    let report = quick(2);
    assert_eq!(report.to_json(), quick(1).to_json());
    let names: Vec<_> = report.rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(names[..6], ["corpus", "Random", "NN", "VAE", "midpoint1", "single"]);
    assert_eq!(report.rows.len(), 6 + 2 * GAZE_TARGETS.len());
    assert_eq!((report.clips, report.windows[0]), (2, 4));

    let truth = &report.rows[0].all;
    assert!(truth.fgd.unwrap() < 1e-9 && truth.ape == Some(0.0) && truth.pck == Some(1.0), "{truth:?}");
    assert!((truth.seam.unwrap() - 1.0).abs() < 0.1, "motion that knows no blocks: {truth:?}");
    assert!(truth.head_angle.unwrap() > 0.9, "the procedural person looks at the user: {truth:?}");
    assert!(truth.beat.unwrap() > truth.beat_shuffled.unwrap(), "and lifts its hands when it speaks: {truth:?}");
    assert!(report.rows[0].wrist_ratio.unwrap() > 1.0);
    // Random weights make no conversation: far from the corpus in pose and gaze, and the report
    // says so.
    let model = &report.rows[4].all;
    assert!(model.fgd.unwrap() > 10.0 * report.rows[2].all.fgd.unwrap(), "{model:?}");
    let missed = |what: &str| report.verdicts.iter().find(|v| v.what.starts_with(what)).unwrap().met == Some(false);
    assert!(missed("FGD, midpoint1") && missed("VAE, joints"), "{:#?}", report.verdicts);

    assert!(report.rows.iter().all(|row| row.all.seam.is_some()), "all motion has blocks");
    let json: serde_json::Value = serde_json::from_str(&report.to_json()).unwrap();
    assert_eq!(json["rows"].as_array().unwrap().len(), report.rows.len());
    for text in [report.to_text(), report.to_markdown()] {
        for word in ["quick look", "corpus", "midpoint1, gaze 0.25", "reconstruction", "endurance", "missed"] {
            assert!(text.contains(word), "{word} in {text}");
        }
    }
}

/// What two bundles are compared by, and no more; a seed changes motion and nothing else.
#[test]
fn motion_alone_has_the_same_figures() {
    let engine = tiny();
    let clips = synthetic(&engine.config().rig, &talk());
    let samplers = vec![Sampler::Midpoint1, Sampler::Single];
    let whole = EvalOptions { windows: 4, samplers, quick: true, ..EvalOptions::default() };
    let run = |seed| {
        let options = EvalOptions { motion_only: true, seed, ..whole.clone() };
        evaluate(&engine, &clips, None, &options, &|_| {}).unwrap()
    };
    let report = run(0);
    let names: Vec<_> = report.rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(names, ["corpus", "VAE", "midpoint1", "single"]);
    assert!(report.dials.is_empty() && report.reaction.is_none() && report.follow.is_none());
    assert!(report.endurance.is_none() && !report.to_text().contains("Gaze dial"));
    let all = quick(2);
    assert_eq!(report.rows[1..], all.rows[3..6]);
    assert_eq!(report.reconstruction, all.reconstruction);
    let batches = &report.rows[2].all.fgd_batches;
    assert_eq!((batches.len(), Some(batches[0])), (1, report.rows[2].all.fgd), "four windows are one batch");
    let other = run(1);
    assert!(other.rows[..2] == report.rows[..2] && other.rows[2] != report.rows[2]);
}

/// A bundle whose poses no body could take is called defective, whether the guard trips again and
/// again or holds without end.
#[test]
fn a_bundle_that_trips_the_guard_is_defective() {
    let bytes = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors")).unwrap();
    let (header, metadata) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    let (from, to) = metadata.info("stats.pose_std").unwrap().data_offsets;
    let endurance = |factor: f32| {
        let mut bytes = bytes.clone();
        for place in bytes[8 + header + from..8 + header + to].chunks_exact_mut(2) {
            let value = half::f16::from_le_bytes([place[0], place[1]]).to_f32();
            place.copy_from_slice(&half::f16::from_f32(factor * value).to_le_bytes());
        }
        let engine = Engine::from_bytes(bytes, "tiny").unwrap();
        let options =
            EvalOptions { windows: 2, samplers: vec![Sampler::Single], quick: true, ..EvalOptions::default() };
        let report = evaluate(&engine, &synthetic(&engine.config().rig, &talk()), None, &options, &|_| {}).unwrap();
        let verdict = report.verdicts.iter().find(|v| v.what == "endurance: plausibility guard").unwrap().clone();
        assert_eq!(report.to_text().contains("this bundle is defective"), verdict.met == Some(false));
        (report.endurance.unwrap(), verdict)
    };
    let (sound, verdict) = endurance(0.25);
    assert!(sound.changes.iter().all(|c| c.periods.len() == sound.periods), "{:?}", sound.changes);
    assert!(!sound.defective && verdict.met == Some(true), "{verdict:?}");
    let (wild, verdict) = endurance(100.0);
    assert!(wild.defective && wild.held > 0.5 && verdict.met == Some(false), "{verdict:?}");
    assert!(wild.finite, "what is shown is finite all the same");
}

#[test]
fn spoilt_motion_is_told_from_the_corpus() {
    let engine = tiny();
    let rig = &engine.config().rig;
    let clips = synthetic(rig, &talk());
    let windows = Window::choose(&clips, 2).unwrap();
    let measure = |spoil: &dyn Fn(usize, &mut Frame)| {
        let of = |window: &Window| {
            let mut frames = window.truth.frames.clone();
            frames.iter_mut().enumerate().for_each(|(i, f)| spoil(i, f));
            Measured::of(rig, window, Played::recorded(rig, frames)).unwrap()
        };
        windows.iter().map(of).collect::<Vec<_>>()
    };
    let truth = measure(&|_, _| {});
    let row = |spoil: &dyn Fn(usize, &mut Frame)| Row::new("spoilt".into(), None, &measure(spoil), &truth);
    let right = row(&|_, _| {}).all;
    // All joints 5 cm higher: FGD is the square of the shift of all 22.
    let higher = row(&|_, f| f.global.iter_mut().for_each(|t| t.position.y += 0.05)).all;
    assert!((higher.fgd.unwrap() - 22.0 * 0.0025).abs() < 2e-3, "{higher:?}");
    assert!((higher.ape.unwrap() - 0.05).abs() < 1e-5 && higher.pck == Some(1.0), "{higher:?}");
    // A jump to the side in every other block.
    let jumpy = row(&|i, f| f.global.iter_mut().for_each(|t| t.position.x += if i % 8 < 4 { 0.0 } else { 0.02 })).all;
    assert!(jumpy.seam.unwrap() > 5.0 && jumpy.fgd_acceleration > right.fgd_acceleration, "{jumpy:?}");
    // Gliding at 10 cm/s.
    let gliding = row(&|i, f| f.global.iter_mut().for_each(|t| t.position.x += i as f32 * 0.1 / 30.0)).all;
    assert!(gliding.foot_slide > right.foot_slide && gliding.support_foot_speed.unwrap() > 0.08, "{gliding:?}");
}

#[test]
fn windows_without_voices_have_all_their_frames() {
    let engine = tiny();
    let clips = synthetic(&engine.config().rig, &talk());
    let mut window = Window::choose(&clips, 1).unwrap().remove(0);
    (window.segment.agent_voice, window.segment.user_voice) = (None, None);
    let options = SessionOptions { sampler: Sampler::Single, ..Default::default() };
    assert_eq!(motion::in_window(&engine, &options, &window).unwrap().len(), WINDOW);
}

#[test]
fn windows_do_not_overlap_and_spread() {
    let engine = tiny();
    let clips = synthetic(&engine.config().rig, &talk());
    let windows = Window::choose(&clips, 3).unwrap();
    assert_eq!(windows.iter().map(|w| w.clip).collect::<Vec<_>>(), [0, 1, 1]);
    assert!(windows.iter().all(|w| w.segment.frames.len() == LEAD + WINDOW && w.truth.frames.len() == WINDOW));
    assert_eq!(Window::choose(&clips, 100).unwrap().len(), 4, "32 s hold two windows");
    assert_eq!(Window::choose(&[], 3).unwrap_err().kind(), ErrorKind::Argument);
}

#[test]
fn nearest_neighbours_are_near() {
    let engine = tiny();
    let clips = synthetic(&engine.config().rig, &talk());
    let windows = Window::choose(&clips, 4).unwrap();
    let bank = Bank::new(clips.clone(), false).unwrap();
    // With its own clip in the bank, a window finds itself, give or take the step of the stretches.
    let found = bank.nearest(&windows[0]).unwrap().unwrap();
    let truth = &windows[0].truth.frames;
    let off = |frames: &[Frame]| {
        let pairs = frames.iter().zip(truth.iter()).flat_map(|(a, b)| a.global.iter().zip(&b.global));
        pairs.map(|(a, b)| a.position.distance(b.position)).fold(0.0, f32::max)
    };
    assert!(off(&found) < 0.5, "{}", off(&found));
    let random: Vec<_> = (0..8).map(|i| bank.random(&windows[0], i).unwrap().unwrap()[0].root).collect();
    assert!(random.iter().all(|r| (r.x - truth[0].root.x).abs() < 1e-4), "put where the agent stands");
    assert!(Bank::new(clips[..1].to_vec(), true).unwrap().nearest(&windows[0]).unwrap().is_none(), "not its own clip");
}

#[test]
fn calibration_measures_the_channel() {
    let engine = tiny();
    let clips = synthetic(&engine.config().rig, &talk());
    // Random weights need not follow their channel; then that is said.
    let outcome = |threads| calibrate(&engine, &clips, 2, threads, &|_| {});
    match (outcome(1), outcome(2)) {
        (Ok(gaze), Ok(again)) => {
            assert_eq!(gaze, again);
            let file =
                visavis::BundleFile::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/tiny.safetensors"));
            let settings = Config { gaze: Some(gaze.clone()), ..engine.config().clone() };
            let bytes = file.unwrap().with_settings(&settings).unwrap();
            assert_eq!(Engine::from_bytes(bytes, "calibrated").unwrap().config().gaze, Some(gaze.clone()));
            assert!(gaze.levels.iter().all(|l| *l > 0.8), "the procedural person looks at the user: {:?}", gaze.levels);
        }
        (Err(a), Err(b)) => assert!(a.to_string().contains("does not follow") && a.to_string() == b.to_string(), "{a}"),
        (a, b) => panic!("one outcome: {a:?}, {b:?}"),
    }
}

/// The shipped model, whose responses are forgotten, finds some again with which it rests as people
/// do, as far as two minutes can tell.
#[test]
#[ignore = "takes a minute; .ci/full runs it"]
fn calibration_of_rest_brings_sessions_near_people() {
    let file = visavis::BundleFile::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../models/visavis-room-i8.safetensors"));
    let file = file.unwrap();
    let settings = file.parse().unwrap().0;
    let with = |rest: &RestConfig| {
        let settings = Config { rest: Some(rest.clone()), ..settings.clone() };
        Engine::from_bytes(file.with_settings(&settings)?, "calibrated")
    };
    let rest = settings.rest.as_ref().unwrap();
    let clips = synthetic(&settings.rig, &talk());
    let found = calibrate_rest(rest, &clips, 1, &with, 2, &|_| {}).unwrap();
    let responses: Vec<_> = found.responses().collect();
    assert_eq!(responses.len(), 2, "both networks");
    for (network, response) in responses {
        let shipped = rest.responses().find(|(name, _)| *name == network).unwrap().1;
        for (own, shipped) in response.curves.iter().zip(&shipped.curves) {
            let (own, shipped) = (own.channel(0.0), shipped.channel(0.0));
            assert!((own - shipped).abs() < 0.8, "{network}: {own}, {shipped}");
        }
        assert!(response.alone.iter().chain(&response.listening).all(|more| more.abs() <= 2.0), "{response:?}");
        assert!((5.0..=40.0).contains(&response.seconds), "{network}: {} s", response.seconds);
    }
    assert!(with(&found).is_ok(), "they can be stored");
}
