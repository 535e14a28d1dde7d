//! Files as Windows has them: what others hold open cannot be replaced, and names have spaces and
//! umlauts. `capi/windows/check.sh` runs this under Wine.
#![cfg(windows)]

#[path = "common/cli.rs"]
mod cli;
#[path = "../../tests/common/mod.rs"]
mod common;

use cli::{Scratch, names, succeeds, tone, visavis};
use common::golden_path;
use std::fs::{File, OpenOptions};
use std::os::windows::fs::OpenOptionsExt;
use std::path::Path;
use visavis::internals::kernels::Kernels;
use visavis::{BundleFile, Engine, ErrorKind};
use visavis_tools::export::write_atomically;

/// Holds a file as programs do that share nothing.
fn hold(path: &Path) -> File {
    OpenOptions::new().read(true).share_mode(0).open(path).expect("a file that nobody else has open")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("Unicode")
}

const ADVICE: &str = "close it there";

#[test]
fn a_held_file_is_not_replaced_and_the_error_says_why() {
    let scratch = Scratch::new("windows-held");
    let path = scratch.file("result.txt", "old");
    let held = hold(&path);
    let e = write_atomically(&path, |w| w.write_all(b"new")).expect_err("it is held");
    assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(path.as_path())));
    assert!(e.to_string().contains(ADVICE), "{e}");
    drop(held);
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(names(&scratch.path("")), ["result.txt"], "a temporary file was left");
    write_atomically(&path, |w| w.write_all(b"new")).expect("nobody holds it");
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
}

/// As scanners do after a file was written.
#[test]
fn a_file_that_is_held_for_a_moment_is_replaced() {
    let scratch = Scratch::new("windows-moment");
    let path = scratch.file("result.txt", "old");
    let held = hold(&path);
    let (begun, begin) = std::sync::mpsc::channel();
    let scanner = std::thread::spawn(move || {
        begin.recv().expect("the writer begins");
        std::thread::sleep(std::time::Duration::from_millis(120));
        drop(held);
    });
    write_atomically(&path, |w| {
        begun.send(()).expect("the scanner is there");
        w.write_all(b"new")
    })
    .expect("replaced in the end");
    scanner.join().unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
}

#[test]
fn a_bundle_that_others_hold_is_a_typed_error() {
    let scratch = Scratch::new("windows-bundle");
    let path = scratch.file("bundle.safetensors", std::fs::read(golden_path("tiny.safetensors")).unwrap());
    let held = hold(&path);
    let e = Engine::load(&path).expect_err("it is held");
    assert_eq!((e.kind(), e.path()), (ErrorKind::Io, Some(path.as_path())));
    assert!(e.to_string().contains(ADVICE), "{e}");
    drop(held);
    Engine::load(&path).expect("nobody holds it");
}

/// The map holds: whoever replaces or cuts the file either does so without harm to it or is told
/// that it cannot be done.
#[test]
fn a_mapped_bundle_survives_whatever_becomes_of_its_file() {
    let scratch = Scratch::new("windows-mapped");
    let bytes = std::fs::read(golden_path("tiny.safetensors")).unwrap();
    let path = scratch.file("bundle.safetensors", &bytes);
    let file = BundleFile::open(&path).expect("it opens");
    let replaced = write_atomically(&path, |w| w.write_all(b"another file"));
    let there = std::fs::read(&path).unwrap();
    match &replaced {
        Ok(()) => assert_eq!(there, b"another file"),
        Err(e) => {
            assert!(e.kind() == ErrorKind::Io && e.to_string().contains(ADVICE), "{e}");
            assert_eq!(there, bytes);
            let cut = OpenOptions::new().write(true).open(&path).and_then(|f| f.set_len(0));
            println!("cutting it: {cut:?}");
            assert!(cut.is_err(), "a mapped file can be cut here");
        }
    }
    println!("replacing it: {:?}", replaced.as_ref().map_err(ToString::to_string));
    Engine::from_file(&file, Kernels::detect().unwrap()).expect("what was opened loads");
    drop(file);
    write_atomically(&path, |w| w.write_all(&bytes)).expect("an engine holds no file");
    Engine::load(&path).expect("it is a bundle again");
}

/// Spaces, umlauts, other scripts, and more than the 260 letters of old.
#[test]
fn folders_may_be_called_anything() {
    let scratch = Scratch::new("windows Größe und Übermaß 模型");
    let voice = scratch.file("Stimme der Agentin, früh.wav", tone(16_000, 0.4));
    let model = scratch.file("Modell (klein).safetensors", std::fs::read(golden_path("tiny.safetensors")).unwrap());
    for out in ["Ergebnis für Zoë".to_owned(), format!("{0}/{0}/{0}", "lang".repeat(30))] {
        let out = scratch.path(&out);
        succeeds(&["generate", "--model", text(&model), "--agent", text(&voice), "--out", text(&out)]);
        assert_eq!(names(&out), ["index.html", "metrics.json", "motion.bvh", "motion.glb", "motion.vrma"]);
    }
}

/// One of the five results is open elsewhere: none of them changes.
#[test]
fn results_stay_together_when_one_is_held() {
    let scratch = Scratch::new("windows-results");
    let (voice, model) = (scratch.file("voice.wav", tone(16_000, 0.4)), golden_path("tiny.safetensors"));
    let out = scratch.path("out");
    let args = ["generate", "--model", text(&model), "--agent", text(&voice), "--out", text(&out), "--seed"];
    let run = |seed| [&args[..], &[seed]].concat();
    let read = || names(&out).iter().map(|name| std::fs::read(out.join(name)).unwrap()).collect::<Vec<_>>();
    succeeds(&run("1"));
    let before = read();
    for name in ["index.html", "motion.glb", "metrics.json"] {
        let held = hold(&out.join(name));
        let output = visavis(&run("2"));
        assert_eq!(output.status.code(), Some(1));
        let message = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(message.contains(name) && message.contains(ADVICE), "{message}");
        drop(held);
        assert!(read() == before, "{name} was held");
        assert_eq!(names(&out).len(), 5);
    }
    succeeds(&run("2"));
    assert!(read() != before);
}
