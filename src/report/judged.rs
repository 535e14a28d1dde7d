//! Every metric of `visavis eval` side by side: the JSON that it wrote for the reference and for each candidate.

use crate::error::{Error, ErrorKind, Result};
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Evaluations on the same clips.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    /// Files that were read, the reference's first.
    pub files: Vec<String>,
    /// What was measured, as `row: class: metric`, and its value in each file.
    pub metrics: Vec<(String, Vec<Option<f64>>)>,
    /// Of each candidate, the relative change of the first sampler's Frechet distance to the corpus.
    pub fgd_change: Vec<Option<f64>>,
}

impl Judged {
    /// Reads one file a bundle.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] for a file that cannot be read, [`ErrorKind::Argument`] for one that is no evaluation.
    pub(super) fn read(files: &[PathBuf]) -> Result<Self> {
        let values = files.iter().map(|file| parse(file)).collect::<Result<Vec<_>>>()?;
        let name = |file: &PathBuf| file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Self::of(files.iter().map(name).collect(), &values))
    }

    fn of(files: Vec<String>, values: &[Value]) -> Self {
        let mut flat: Vec<Vec<(String, f64)>> = Vec::new();
        for value in values {
            let mut leaves = Vec::new();
            for row in value["rows"].as_array().into_iter().flatten().filter(|row| is_generated(row)) {
                numbers(row, row["name"].as_str().unwrap_or("?"), &mut leaves);
            }
            numbers(&value["reconstruction"], "reconstruction", &mut leaves);
            flat.push(leaves);
        }
        let find = |leaves: &[(String, f64)], name: &str| leaves.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
        let names = flat.first().into_iter().flatten().map(|(name, _)| name.clone());
        let metrics: Vec<_> = names
            .map(|name| (name.clone(), flat.iter().map(|leaves| find(leaves, &name)).collect::<Vec<_>>()))
            .collect();
        let fgd = metrics.iter().find(|(name, _)| name.ends_with(": all: fgd")).map(|(_, values)| values.clone());
        let change = |i: usize| {
            let (reference, candidate) = ((*fgd.as_ref()?.first()?)?, (*fgd.as_ref()?.get(i)?)?);
            Some((candidate - reference).abs() / reference)
        };
        Self { fgd_change: (1..files.len()).map(change).collect(), files, metrics }
    }
}

fn parse(file: &Path) -> Result<Value> {
    let text = std::fs::read_to_string(file).map_err(|e| Error::io("read the evaluation", file, e))?;
    let bad = |what: String| {
        let message = format!("is not what `visavis eval --json` writes ({what})");
        Error::new(ErrorKind::Argument, message).with_path(file)
    };
    let value: Value = serde_json::from_str(&text).map_err(|e| bad(e.to_string()))?;
    if value["rows"].is_array() { Ok(value) } else { Err(bad("it has no rows".to_owned())) }
}

/// Rows of motion that the model made with free gaze; the corpus and what was looked up in it are the same for all bundles.
fn is_generated(row: &Value) -> bool {
    let name = row["name"].as_str().unwrap_or_default();
    row["gaze_target"].is_null() && !["corpus", "Random", "NN"].contains(&name)
}

/// All numbers inside `value`, named by the way to them.
fn numbers(value: &Value, path: &str, out: &mut Vec<(String, f64)>) {
    match value {
        Value::Number(n) => out.extend(n.as_f64().map(|v| (path.to_owned(), v))),
        Value::Object(map) => map.iter().for_each(|(key, v)| numbers(v, &format!("{path}: {key}"), out)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn evaluation(fgd: f64) -> Value {
        json!({"rows": [
            {"name": "corpus", "gaze_target": null, "all": {"fgd": 0.0}},
            {"name": "midpoint4", "gaze_target": null, "all": {"fgd": fgd, "seam": 1.1}, "wrist_ratio": null},
            {"name": "midpoint4, gaze 0.5", "gaze_target": 0.5, "all": {"fgd": 9.0}},
            {"name": "single", "gaze_target": null, "all": {"fgd": 2.0 * fgd}},
        ], "reconstruction": {"mm": 12.5}})
    }

    #[test]
    fn metrics_stand_side_by_side() {
        let files = ["f16", "i8"].map(str::to_owned).to_vec();
        let judged = Judged::of(files, &[evaluation(0.5), evaluation(0.51)]);
        let names: Vec<_> = judged.metrics.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["midpoint4: all: fgd", "midpoint4: all: seam", "single: all: fgd", "reconstruction: mm"]);
        assert_eq!(judged.metrics[2].1, [Some(1.0), Some(1.02)]);
        assert!((judged.fgd_change[0].unwrap() - 0.02).abs() < 1e-9);
    }
}
