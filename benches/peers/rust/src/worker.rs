//! A worker: one line of JSON in, one out. `{"time": N}` runs N blocks and answers `{"ms": [..]}`;
//! `{"check": "FILE"}` runs the prepared blocks from the start and writes what came out. Between
//! lines a worker does nothing.

use crate::Result;
use serde_json::{Value, json};
use std::io::{BufRead, Write};

/// What a worker measures.
pub trait Blocks {
    /// Runs the prepared blocks from the start; flat `latents` and `decoded`.
    fn check(&mut self) -> Result<(Vec<f32>, Vec<f32>)>;
    /// Runs one more block; milliseconds.
    fn block(&mut self) -> Result<f64>;
}

/// Answers the driver until its end closes.
pub fn serve(blocks: &mut dyn Blocks) -> Result<()> {
    let mut out = std::io::stdout();
    writeln!(out, "{}", json!({"ready": true, "peak": peak()}))?;
    out.flush()?;
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line?)?;
        let answer = if let Some(n) = request["time"].as_u64() {
            let ms = (0..n).map(|_| blocks.block()).collect::<Result<Vec<f64>>>()?;
            json!({"ms": ms, "peak": peak(), "resident": status("VmRSS:")})
        } else {
            let path = request["check"].as_str().ok_or("a request is {\"time\": N} or {\"check\": FILE}")?;
            let (latents, decoded) = blocks.check()?;
            let bytes = [&latents, &decoded].map(|v| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
            let view = |i: usize| {
                safetensors::tensor::TensorView::new(safetensors::Dtype::F32, vec![bytes[i].len() / 4], &bytes[i])
            };
            let file = safetensors::serialize([("latents", view(0)?), ("decoded", view(1)?)], None)?;
            std::fs::write(path, file)?;
            json!({"written": path})
        };
        writeln!(out, "{answer}")?;
        out.flush()?;
    }
    Ok(())
}

fn peak() -> Option<u64> {
    status("VmHWM:")
}

/// Bytes that the system tells of this process under `key`.
fn status(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(key))?;
    Some(1024 * line.split_whitespace().nth(1)?.parse::<u64>().ok()?)
}
