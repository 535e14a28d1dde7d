//! What is kept is what was measured, and what is read back is checked.

use super::super::elsewhere::Elsewhere;
use super::super::tests::{talk, tiny};
use super::super::{EvalOptions, LEAD, Report, WINDOW, evaluate, synthetic};
use super::*;
use crate::export::scratch::Scratch;
use safetensors::SafeTensors;
use visavis::{Rig, Sampler, Transform};

fn report(dir: &Path, threads: usize, rows: Vec<(String, PathBuf)>) -> Report {
    let engine = tiny();
    let options = EvalOptions {
        windows: 3,
        threads,
        samplers: vec![Sampler::Midpoint1, Sampler::euler(2).unwrap()],
        quick: true,
        motion_only: true,
        rows,
        keep: Some(dir.to_path_buf()),
        ..EvalOptions::default()
    };
    evaluate(&engine, &synthetic(&engine.config().rig, &talk()), None, &options, &|_| {}).unwrap()
}

fn names(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn a_row_that_was_kept_has_the_same_figures_when_it_is_read_back() {
    let scratch = Scratch::new("keep");
    let (kept, again) = (scratch.path("kept"), scratch.path("again"));
    let first = report(&kept, 2, Vec::new());
    assert_eq!(names(&kept), ["VAE", "corpus", "euler-2", "midpoint1"]);
    let of_windows = ["000.safetensors", "001.safetensors", "002.safetensors"];
    assert_eq!(names(&kept.join("corpus")), of_windows);

    let rows = [("model", "midpoint1"), ("recorded", "corpus")];
    let rows = rows.map(|(name, row)| (name.to_owned(), kept.join(row)));
    let second = report(&again, 1, rows.to_vec());
    let order: Vec<_> = second.rows.iter().map(|row| row.name.as_str()).collect();
    assert_eq!(order, ["corpus", "VAE", "midpoint1", "euler:2", "model", "recorded"]);
    assert_eq!(second.models().count(), 2, "rows made elsewhere are not the bundle's");
    for (name, original) in [("model", "midpoint1"), ("recorded", "corpus")] {
        let (row, own) = (second.row(name).unwrap(), first.row(original).unwrap());
        let [a, b] = [row, own].map(|row| serde_json::to_value(row).unwrap());
        let mut compared = 0;
        for part in ["all", "speaking", "non_speaking", "listens", "talks"] {
            for (key, b) in b[part].as_object().unwrap() {
                let Some((a, b)) = a[part][key].as_f64().zip(b.as_f64()).filter(|_| key != "bone_deviation") else {
                    assert_eq!(a[part][key].is_null(), b.is_null(), "{name}, {part}: {key}");
                    continue;
                };
                assert!((a - b).abs() <= 1e-4 * b.abs() + 1e-7, "{name}, {part}: {key} is {a}, was {b}");
                compared += 1;
            }
        }
        assert!(compared > 30, "{name}: {compared}");
        assert!(row.all.bone_deviation.unwrap() < 1e-5, "what is kept is on the rig");
        assert!(!row.model && row.all.windows == 3);
    }
    assert!(first.row("midpoint1").unwrap().all.bone_deviation.unwrap() > 0.01, "as decoded");

    for file in of_windows {
        for row in ["corpus", "VAE", "euler-2"] {
            let [a, b] = [&kept, &again].map(|dir| std::fs::read(dir.join(row).join(file)).unwrap());
            assert!(a == b, "{row}/{file}: other bytes on another number of threads");
        }
    }
    let text = second.to_text();
    assert!(text.contains("\nmodel ") && second.to_markdown().contains("| recorded, listening |"), "{text}");
}

#[test]
fn a_kept_window_says_what_it_is_of() {
    let scratch = Scratch::new("keep-notes");
    let engine = tiny();
    let rig = &engine.config().rig;
    let clips = synthetic(rig, &talk());
    let windows = Window::choose(&clips, 3).unwrap();
    let dir = scratch.path("kept");
    let keep = Keep::new(&dir, &clips, "tiny").unwrap();
    let (window, truth) = (&windows[2], &windows[2].truth);
    keep.write("corpus", 2, window, &truth.frames, true).unwrap();
    keep.write("NN", 2, window, &truth.frames, false).unwrap();

    let clip = Clip::open(dir.join("corpus/002.safetensors"), rig).unwrap();
    let source = &clips[window.clip];
    assert_eq!(clip.note("clip"), Some(source.name().as_str()));
    let first: usize = clip.note("first_frame").unwrap().parse().unwrap();
    assert_eq!((first, window.first % (LEAD + WINDOW)), (window.first, LEAD));
    let (kept, there) = (clip.read(0, WINDOW).unwrap(), source.read(first, WINDOW).unwrap());
    assert!(kept.agent_voice == there.agent_voice && kept.user_voice == there.user_voice && kept.user == there.user);
    let same = |a: &Transform, b: &Transform| a.position == b.position && a.rotation.dot(b.rotation) > 1.0 - 1e-6;
    for (a, b) in kept.frames.iter().zip(&there.frames) {
        assert!(a.global.iter().zip(&b.global).all(|(a, b)| same(a, b)));
    }
    let other = std::fs::read(dir.join("NN/002.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&other).unwrap();
    let mut held = tensors.names();
    held.sort_unstable();
    assert_eq!(held, ["positions", "rotations", "user_head"]);

    keep.forget("NN").unwrap();
    assert_eq!(names(&dir), ["corpus"]);
    let e = Keep::new(&dir, &clips, "tiny").unwrap_err();
    assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("empty it"), "{e}");
}

#[test]
fn rows_that_cannot_be_judged_are_refused_by_name() {
    let scratch = Scratch::new("elsewhere");
    let engine = tiny();
    let rig = &engine.config().rig;
    let clips = synthetic(rig, &talk());
    let windows = Window::choose(&clips, 2).unwrap();
    let dir = scratch.path("rows");
    let keep = Keep::new(&dir, &clips, "tiny").unwrap();
    let write = |i: usize, frames: &[Frame]| keep.write("mine", i, &windows[i], frames, false).unwrap();
    for (i, window) in windows.iter().enumerate() {
        write(i, &window.truth.frames);
    }
    let (mine, made) = (dir.join("mine"), ["euler:2".to_owned()]);
    let open = |name: &str, dir: &Path, windows: &[Window], rig: &Rig| {
        Elsewhere::open(&(name.to_owned(), dir.to_path_buf()), &made, windows, &clips, rig)
    };
    let row = open("mine", &mine, &windows, rig).unwrap();
    assert_eq!(row.motion(1).unwrap().len(), WINDOW);
    let fails = |windows: &[Window], rig: &Rig, at: &str, part: &str| {
        let e = open("mine", &mine, windows, rig).unwrap_err();
        assert_eq!((e.kind(), e.path()), (ErrorKind::Argument, Some(mine.join(at).as_path())), "{e}");
        assert!(e.to_string().contains(part), "expected `{part}`: {e}");
    };

    fails(&windows[..1], rig, "001.safetensors", "only 1 windows");
    let other = Window::choose(&clips, 4).unwrap();
    fails(&[windows[0].clone(), other[1].clone()], rig, "001.safetensors", "for these clips");
    let mut taller = rig.clone();
    taller.joints.push(rig.joints[5].clone());
    fails(&windows, &taller, "000.safetensors", "23 joints");
    write(1, &windows[1].truth.frames[..399]);
    fails(&windows, rig, "001.safetensors", "is F32 [400, 3], not F32 [399, 3]");
    let short = Window { truth: windows[1].truth.cut(0, 399), ..windows[1].clone() };
    keep.write("mine", 1, &short, &short.truth.frames, false).unwrap();
    fails(&windows, rig, "001.safetensors", "399 frames; a window has 400");
    let mut frames = windows[1].truth.frames.clone();
    frames[7].global[3].position.y = f32::NAN;
    write(1, &frames);
    fails(&windows, rig, "001.safetensors", "not finite");
    std::fs::remove_file(mine.join("001.safetensors")).unwrap();
    let here = format!("write one for frames {} to {}", windows[1].first, windows[1].first + WINDOW);
    fails(&windows, rig, "001.safetensors", &here);

    let named = |name: &str, dir: &Path| open(name, dir, &windows, rig).unwrap_err();
    let e = named("mine", &scratch.path("nowhere"));
    assert!(e.to_string().contains("no such folder") && e.to_string().contains("nowhere"), "{e}");
    for bad in ["", "a/b", "..", "a b", "dot.", "-row"] {
        let e = named(bad, &mine);
        assert!(e.kind() == ErrorKind::Argument && e.to_string().contains("is no name for a row"), "{bad}: {e}");
    }
    for taken in ["corpus", "vae", "nn", "other", "Euler-2"] {
        assert!(named(taken, &mine).to_string().contains("another name"), "{taken}");
    }
}
