//! Disks that are full, files that change under the reader: a typed error, one line, and nothing
//! half-written.
//!
//! The disk is full for a child process alone: its files may not grow beyond a limit
//! (`RLIMIT_FSIZE`, its signal ignored), so writes fail as they do on a full disk, in every writer
//! and at every size.
#![cfg(target_os = "linux")]
#![allow(unsafe_code, reason = "limits of a child are set between fork and exec")]

#[path = "common/cli.rs"]
mod cli;
#[path = "../../tests/common/mod.rs"]
mod common;

use cli::{Scratch, names, tone};
use common::golden_path;
use std::fs::OpenOptions;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use visavis::{BundleFile, Engine, ErrorKind, LoadMode};

/// Runs the program with files of at most `bytes` bytes.
fn limited(bytes: u64, args: &[&str]) -> Output {
    let mut command = cli::command();
    command.args(args).current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let limit = libc::rlimit { rlim_cur: bytes, rlim_max: bytes };
    // SAFETY: between fork and exec only two calls that are safe there; `limit` is copied.
    unsafe {
        command.pre_exec(move || {
            libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
            match libc::setrlimit(libc::RLIMIT_FSIZE, &limit) {
                0 => Ok(()),
                _ => Err(std::io::Error::last_os_error()),
            }
        });
    }
    command.output().expect("the program starts")
}

/// The one line of a run that must have failed for the disk.
fn disk_error(output: &Output) -> String {
    let message = String::from_utf8(output.stderr.clone()).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{message}");
    let last = message.lines().last().expect("a message").to_owned();
    assert!(last.starts_with("visavis: ") && last.contains("cannot write"), "{message}");
    last
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// Every file of a run in turn is the one that does not fit; what an earlier run left stays as it
/// was.
#[test]
fn a_full_disk_leaves_no_half_file() {
    let scratch = Scratch::new("faults-full");
    let wav = scratch.file("voice.wav", tone(16_000, 1.0));
    let model = golden_path("tiny.safetensors");
    let out = scratch.path("out");
    let args = ["generate", "--model", text(&model), "--agent", text(&wav), "--out", text(&out)];

    let whole = limited(u64::MAX, &args);
    assert_eq!(whole.status.code(), Some(0), "{}", String::from_utf8_lossy(&whole.stderr));
    let files = names(&out);
    let read = || files.iter().map(|name| std::fs::read(out.join(name)).expect("a result")).collect::<Vec<_>>();
    let before = read();
    let mut sizes: Vec<_> = before.iter().map(|bytes| bytes.len() as u64).collect();
    sizes.sort_unstable();
    // Under each size by a byte, and at nothing at all.
    for limit in sizes.iter().map(|size| size - 1).chain([0, 100]) {
        disk_error(&limited(limit, &args));
        assert_eq!(names(&out), files, "limit {limit}");
        assert_eq!(read(), before, "limit {limit}");
        let fresh = scratch.path("fresh");
        let mut other = args;
        other[6] = text(&fresh);
        disk_error(&limited(limit, &other));
        assert!(!fresh.exists(), "limit {limit}: a folder made in vain is removed");
    }
    assert_eq!(names(&scratch.path("")), ["out", "voice.wav"]);
}

#[test]
fn a_trace_on_a_full_disk_leaves_nothing() {
    let scratch = Scratch::new("faults-trace");
    let (model, input) = (golden_path("tiny.safetensors"), golden_path("tiny-golden.safetensors"));
    let out = scratch.path("stages.safetensors");
    let args = ["trace", "--model", text(&model), "--input", text(&input), "--out", text(&out)];
    for limit in [0, 1000, 100_000] {
        let message = disk_error(&limited(limit, &args));
        assert!(message.contains("stages.safetensors"), "{message}");
        assert!(names(&scratch.path("")).is_empty(), "limit {limit}");
    }
}

/// The other writers: bundles, evaluations, reports.
#[test]
fn no_writer_leaves_half_a_file() {
    let scratch = Scratch::new("faults-writers");
    let (f16, i8) = (golden_path("tiny.safetensors"), scratch.path("i8.safetensors"));
    let (f16, i8) = (text(&f16), text(&i8));
    let (file, folder) = (scratch.path("result"), scratch.path("results"));
    let (file, folder) = (text(&file), text(&folder));
    let made = limited(u64::MAX, &["quantize", f16, i8, "--scheme", "i8"]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let eval = ["eval", "--model", f16, "--quick", "--windows", "1", "--sampler", "single"];
    let report = ["report", "--reference", f16, "--candidate", i8, "--quick"];
    for args in [
        &["quantize", f16, file, "--scheme", "i8"][..],
        &[&eval[..], &["--md", file]].concat(),
        &[&report[..], &["--out", folder]].concat(),
    ] {
        disk_error(&limited(100, args));
        let left = names(&scratch.path(""));
        assert!(!left.iter().any(|name| name == "result" || name.starts_with('.')), "{args:?} left {left:?}");
    }
    assert!(names(Path::new(folder)).is_empty());
}

#[test]
fn a_full_standard_output_is_an_error() {
    let full = OpenOptions::new().write(true).open("/dev/full").expect("/dev/full");
    let model = golden_path("tiny.safetensors");
    let output = cli::command()
        .args(["inspect", text(&model)])
        .stdout(full)
        .stderr(Stdio::piped())
        .output()
        .expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.starts_with("visavis: cannot write to stdout: "), "{message}");
}

/// A copied bundle does not care what becomes of its file; a mapped one does not care about a
/// rename over it.
#[test]
fn a_bundle_may_be_replaced_while_it_is_open() {
    let scratch = Scratch::new("faults-replaced");
    let bytes = std::fs::read(golden_path("tiny.safetensors")).expect("the tiny bundle");
    let load =
        |file: &BundleFile| Engine::from_file(file, visavis::internals::kernels::Kernels::detect().expect("kernels"));
    for (mode, cut) in [(LoadMode::Copy, true), (LoadMode::Copy, false), (LoadMode::Map, false)] {
        let path = scratch.file("bundle.safetensors", &bytes);
        let file = BundleFile::open_with(&path, mode).expect("it opens");
        if cut {
            std::fs::write(&path, &bytes[..1000]).expect("cut in place");
        } else {
            let other = scratch.file("other", b"something else");
            std::fs::rename(other, &path).expect("replaced by a rename");
        }
        load(&file).expect("what was opened loads");
    }
    let path = scratch.file("cut.safetensors", &bytes[..bytes.len() / 2]);
    for mode in [LoadMode::Copy, LoadMode::Map] {
        let e = Engine::load_with(&path, mode).expect_err("cut before it was opened");
        assert_eq!((e.kind(), e.path()), (ErrorKind::BundleCorrupt, Some(path.as_path())));
    }
    let e = Engine::load_with("/dev/zero", LoadMode::Copy);
    assert!(e.is_err(), "a device without an end");
}

/// What `LoadMode::Map` warns of, so that the warning stays true: a child maps a bundle and cuts
/// it.
#[test]
fn a_map_that_is_cut_is_a_bus_error() {
    const CHILD: &str = "VISAVIS_FAULTS_CUT";
    if let Some(path) = std::env::var_os(CHILD) {
        let file = BundleFile::open(&path).expect("it opens");
        OpenOptions::new().write(true).open(&path).and_then(|f| f.set_len(0)).expect("cut in place");
        let _ = file.parse();
        return;
    }
    if cfg!(not(target_arch = "x86_64")) {
        println!("skipped: emulators have signals of their own");
        return;
    }
    let scratch = Scratch::new("faults-cut");
    let path =
        scratch.file("bundle.safetensors", std::fs::read(golden_path("tiny.safetensors")).expect("the tiny bundle"));
    let output = Command::new(std::env::current_exe().expect("this program"))
        .args(["--exact", "a_map_that_is_cut_is_a_bus_error", "--nocapture"])
        .env(CHILD, &path)
        .output()
        .expect("this program starts");
    assert_eq!(output.status.signal(), Some(libc::SIGBUS), "{}", String::from_utf8_lossy(&output.stderr));
}
