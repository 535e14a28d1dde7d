//! Running the `visavis` program and looking at what it leaves behind.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for a test, removed at the end.
pub struct Scratch(PathBuf);

impl Scratch {
    pub fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a scratch folder");
        Self(folder)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes a file and returns its path.
    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).expect("write a scratch file");
        path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Names in a folder, sorted, hidden ones too; none if there is no such folder.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<_> = entries.map(|e| e.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A mono 16-bit WAV file.
pub fn wav(rate: u32, samples: &[f32]) -> Vec<u8> {
    let spec =
        hound::WavSpec { channels: 1, sample_rate: rate, bits_per_sample: 16, sample_format: hound::SampleFormat::Int };
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec).expect("a WAV header");
    for s in samples {
        writer.write_sample((s * 32767.0) as i16).expect("a sample");
    }
    writer.finalize().expect("a WAV file");
    bytes.into_inner()
}

/// `seconds` of a tone that comes and goes.
pub fn tone(rate: u32, seconds: f32) -> Vec<u8> {
    let samples: Vec<_> = (0..(seconds * rate as f32) as u32)
        .map(|i| {
            let t = i as f32 / rate as f32;
            0.3 * (t * 800.0).sin() * (t * 20.0).sin().max(0.0)
        })
        .collect();
    wav(rate, &samples)
}

/// The program; on an emulated architecture behind the runner that Cargo uses for the tests
/// themselves.
pub fn command() -> Command {
    let program = env!("CARGO_BIN_EXE_visavis");
    let runner = match std::env::var("CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER") {
        Ok(words) if cfg!(target_arch = "aarch64") => words,
        _ => return Command::new(program),
    };
    let mut words = runner.split_whitespace();
    let mut command = Command::new(words.next().expect("a runner"));
    command.args(words).arg(program);
    command
}

/// Runs the program in the repository's root.
pub fn visavis<S: AsRef<std::ffi::OsStr>>(args: &[S]) -> Output {
    command().args(args).current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).output().expect("the program starts")
}

/// Standard output of a run that must succeed.
pub fn succeeds<S: AsRef<std::ffi::OsStr>>(args: &[S]) -> String {
    let output = visavis(args);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Standard error of a run that must fail with exit code `code`: `visavis: ...`, and nothing on
/// standard output.
pub fn fails<S: AsRef<std::ffi::OsStr>>(code: i32, args: &[S]) -> String {
    let output = visavis(args);
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    assert!(output.stdout.is_empty(), "nothing is printed where nothing was done");
    assert!(stderr.starts_with("visavis: "), "{stderr}");
    if code == 1 {
        assert_eq!(stderr.lines().count(), 1, "one line: {stderr}");
    }
    stderr
}
