//! Cold start and memory, from outside: a process of its own that loads a bundle, makes a frame,
//! and goes on for a while.

use serde::Serialize;
use std::io::{BufRead, BufReader, Error, Result};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::{BundleFile, Engine, Sampler, SessionOptions};
use visavis_tools::bench::{Size, memory};
use visavis_tools::export::write_atomically;

use super::bench::{BenchArgs, NetworkSet};

/// Processes that are started one after the other; one more before them, which brings the file into
/// the system's cache, is not counted.
const RUNS: usize = 5;
/// What a process says on its first frame.
const FRAME: &str = "first frame";

/// Measured over [`RUNS`] processes of a sampler and number of threads.
#[derive(Debug, Clone, Serialize)]
pub struct ColdStart {
    pub(super) sampler: String,
    threads: usize,
    /// From just before the process is started to its first frame, milliseconds: median.
    first_frame_ms: f64,
    /// Blocks that the last of the processes went on for, as many as the caches hold.
    blocks: usize,
    /// Memory resident after them, bytes, where the system tells.
    resident_bytes: Option<u64>,
    /// The most that was, from the start of that process.
    peak_resident_bytes: Option<u64>,
}

impl ColdStart {
    /// For people.
    pub fn line(&self) -> String {
        let mb = |bytes: Option<u64>| bytes.map_or_else(|| "unknown".into(), |b| format!("{} MB", b / 1_000_000));
        let threads = if self.threads == 1 { "1 thread" } else { "2 threads" };
        format!(
            "cold start, {}, {threads}: {:.0} ms from the start of the process to its first frame; after {} blocks {} resident, at most {} before\n",
            self.sampler,
            self.first_frame_ms,
            self.blocks,
            mb(self.resident_bytes),
            mb(self.peak_resident_bytes),
        )
    }
}

/// A bundle's file, of its own if it is drawn for the occasion: gone with this value.
pub struct File {
    path: PathBuf,
    drawn: bool,
}

impl File {
    /// The bundle at `path`.
    pub fn of(path: PathBuf) -> Self {
        Self { path, drawn: false }
    }

    /// A bundle of seeded weights in the system's folder for temporary files.
    ///
    /// # Errors
    /// Those of writing it.
    pub fn drawn(size: Size, scheme: Scheme) -> visavis::Result<Self> {
        let path = std::env::temp_dir().join(format!("visavis-bench-{}.safetensors", std::process::id()));
        let bytes = size.bundle(scheme)?;
        write_atomically(&path, |w| w.write_all(&bytes))?;
        Ok(Self { path, drawn: true })
    }
}

impl Drop for File {
    fn drop(&mut self) {
        if self.drawn {
            // A file that is gone already needs no removing.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Starts processes that load `file` and run a session.
///
/// # Errors
/// Those of starting this program anew; or one of the processes says no frame.
pub fn measure(file: &File, sampler: Sampler, threads: usize, networks: NetworkSet) -> Result<ColdStart> {
    let program = std::env::current_exe()?;
    let blocks =
        // Predictors without caches go on for two seconds.
        BundleFile::open(&file.path).and_then(|f| Ok(f.parse()?.0.flow.window_blocks.max(15))).map_err(Error::other)?;
    let mut times = Vec::new();
    let mut bytes = String::new();
    for run in 0..=RUNS {
        let blocks = if run == RUNS { blocks } else { 0 };
        let mut command = Command::new(&program);
        command.args(["bench", "--child", "--blocks", &blocks.max(1).to_string()]);
        command.args(["--sampler", &sampler.to_string(), "--threads", &threads.to_string()]);
        command.args(["--networks", networks.name()]).arg("--model").arg(&file.path);
        let started = Instant::now();
        let mut child = command.stdout(Stdio::piped()).spawn()?;
        let mut lines = BufReader::new(child.stdout.take().ok_or_else(|| Error::other("no output"))?);
        let mut said = String::new();
        lines.read_line(&mut said)?;
        let time = started.elapsed();
        bytes.clear();
        lines.read_line(&mut bytes)?;
        if !child.wait()?.success() || said.trim() != FRAME {
            return Err(Error::other("the process made no frame"));
        }
        if run > 0 {
            times.push(1000.0 * time.as_secs_f64());
        }
    }
    times.sort_by(f64::total_cmp);
    let mut bytes = bytes.split_whitespace().map(|word| word.parse().ok());
    Ok(ColdStart {
        sampler: sampler.to_string(),
        threads,
        first_frame_ms: times[RUNS / 2],
        blocks,
        resident_bytes: bytes.next().flatten(),
        peak_resident_bytes: bytes.next().flatten(),
    })
}

/// What such a process does.
///
/// # Errors
/// Those of loading and of the session.
pub fn child(args: &BenchArgs, path: &Path) -> visavis::Result<()> {
    let networks = args.networks.of(&args.sampler);
    let engine = Engine::from_file_with(&BundleFile::open(path)?, Kernels::detect()?, networks)?;
    let options = SessionOptions { sampler: args.sampler[0], threads: args.threads[0], ..SessionOptions::default() };
    let mut session = engine.session(options)?;
    for block in 0..args.blocks {
        session.poll(session.next_due())?;
        if block == 0 {
            super::print(&format!("{FRAME}\n"))?;
        }
    }
    let [resident, peak] = memory().map(|bytes| bytes.map_or_else(|| "-".to_owned(), |b| b.to_string()));
    super::print(&format!("{resident} {peak}\n"))
}
