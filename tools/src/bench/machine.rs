//! The machine that measures.

use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Bytes that each thread reads: well beyond any cache.
const BYTES: usize = 96 << 20;
/// Streams that a thread reads side by side, as the kernels do.
const STREAMS: usize = 8;
const REPEATS: usize = 7;

/// What the system tells about itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    /// The processor's name, or its architecture where the system gives no name.
    pub cpu: String,
    /// Logical processors that this process may use.
    pub processors: usize,
}

impl Machine {
    /// This machine.
    pub fn here() -> Self {
        let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let value = |key: &str| {
            let line = info.lines().find(|line| line.starts_with(key))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        };
        let cpu =
            value("model name").or_else(|| value("Hardware")).unwrap_or_else(|| std::env::consts::ARCH.to_owned());
        Self { cpu, processors: std::thread::available_parallelism().map_or(1, usize::from) }
    }
}

/// GB/s that `threads` threads get from memory, all together, with a plain loop over eight streams
/// each: the median of seven.
///
/// It is what this loop gets on this machine now, other load included, not what the memory could
/// give.
pub fn read_limit(threads: usize) -> f64 {
    let mut rates: Vec<f64> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(rates)).collect();
        // A worker only adds numbers; should it panic all the same, it counts as nothing read.
        let each: Vec<_> = workers.into_iter().map(|w| w.join().unwrap_or([0.0; REPEATS])).collect();
        (0..REPEATS).map(|i| each.iter().map(|rates| rates[i]).sum()).collect()
    });
    rates.sort_by(f64::total_cmp);
    rates[REPEATS / 2]
}

fn rates() -> [f64; REPEATS] {
    let data: Vec<u64> = (0..BYTES as u64 / 8).collect();
    [(); REPEATS].map(|()| {
        let started = Instant::now();
        black_box(sum(black_box(&data)));
        BYTES as f64 / started.elapsed().as_secs_f64().max(1e-9) / 1e9
    })
}

fn sum(data: &[u64]) -> u64 {
    let mut sums = [[0u64; 8]; STREAMS];
    let part = data.len() / STREAMS;
    let lines: [&[[u64; 8]]; STREAMS] = std::array::from_fn(|s| data[s * part..(s + 1) * part].as_chunks::<8>().0);
    for i in 0..lines[0].len() {
        for (sums, lines) in sums.iter_mut().zip(&lines) {
            sums.iter_mut().zip(&lines[i]).for_each(|(sum, value)| *sum = sum.wrapping_add(*value));
        }
    }
    sums.as_flattened().iter().fold(0, |all, sum| all.wrapping_add(*sum))
}

/// Lets the count of the most resident memory start anew, where the system has that.
pub(super) fn reset_peak() {
    // Without it the peak is the whole process's, as the report says.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Memory of this process that is resident now, and the most that was since its start, bytes, where
/// the system tells.
pub fn memory() -> [Option<u64>; 2] {
    [resident(), peak_resident()]
}

/// Memory of this process that is resident now, bytes.
pub(super) fn resident() -> Option<u64> {
    status("VmRSS:")
}

/// The most that was, since [`reset_peak`].
pub(super) fn peak_resident() -> Option<u64> {
    status("VmHWM:")
}

fn status(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    Some(1024 * line.split_whitespace().nth(1)?.parse::<u64>().ok()?)
}
