//! Every metric of `visavis eval` side by side: the JSON that it wrote for the reference and for
//! each candidate.

use crate::metrics::mean_and_error2;
use serde::Serialize;
use serde_json::Value;
use std::path::{Path, PathBuf};
use visavis::{Error, ErrorKind, Result};

/// Evaluations on the same clips.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    /// Files that were read, the reference's first; last, where there is one, that of the reference
    /// with another seed.
    pub files: Vec<String>,
    /// What was measured, as `row: class: metric`, and its value in each file.
    pub metrics: Vec<(String, Vec<Option<f64>>)>,
    /// Change of the Frechet distance to the corpus of each candidate, sampler by sampler.
    pub fgd: Vec<Vec<FgdChange>>,
    /// The same of the reference with another seed.
    pub chance: Option<Vec<FgdChange>>,
}

/// What becomes of a sampler's Frechet distance to the corpus (FGD), relative to the reference's:
/// `(d' - d) / d`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FgdChange {
    /// The sampler.
    pub sampler: String,
    /// The reference's distance, m².
    pub reference: f64,
    /// Relative change.
    pub change: f64,
    /// Standard error of the change, from what batches of the same windows differ by; none with
    /// fewer than two batches.
    pub error: Option<f64>,
}

impl Judged {
    /// Reads one file a bundle, and one of the reference with another seed.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] for a file that cannot be read, [`ErrorKind::Argument`] for one that is no
    /// evaluation, or is of other clips or of another number of windows than the first.
    pub(super) fn read(files: &[PathBuf], other_seed: Option<&Path>) -> Result<Self> {
        let all: Vec<&Path> = files.iter().map(PathBuf::as_path).chain(other_seed).collect();
        let values = all.iter().map(|file| parse(file)).collect::<Result<Vec<_>>>()?;
        if let Some(i) = odd_one(&values) {
            let message = format!("is of other clips or windows than {}; evaluate all alike", all[0].display());
            return Err(Error::new(ErrorKind::Argument, message).with_path(all[i]));
        }
        let name = |file: &&Path| file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Self::of(all.iter().map(name).collect(), &values, other_seed.is_some()))
    }

    fn of(files: Vec<String>, values: &[Value], other_seed: bool) -> Self {
        let mut flat: Vec<Vec<(String, f64)>> = Vec::new();
        for value in values {
            let mut leaves = Vec::new();
            for row in generated(value) {
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
        let (reference, others) = values.split_first().map_or((&Value::Null, values), |(first, rest)| (first, rest));
        let mut fgd: Vec<_> = others.iter().map(|other| changes(reference, other)).collect();
        let chance = if other_seed { fgd.pop() } else { None };
        Self { files, metrics, fgd, chance }
    }

    /// The largest change of candidate `i`, whichever sampler's and direction.
    pub(super) fn worst(&self, i: usize) -> Option<f64> {
        self.fgd.get(i)?.iter().map(|c| c.change.abs()).reduce(f64::max)
    }
}

/// Each sampler of `other` that `reference` has too.
fn changes(reference: &Value, other: &Value) -> Vec<FgdChange> {
    let pair = |row: &Value| {
        let old = generated(reference).find(|r| r["name"] == row["name"])?;
        let distance = |row: &Value| row["all"]["fgd"].as_f64();
        let (d, new) = (distance(old)?, distance(row)?);
        let batches = |row: &Value| -> Vec<f64> {
            row["all"]["fgd_batches"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
        };
        let (a, b) = (batches(old), batches(row));
        let error = (a.len() > 1 && a.len() == b.len()).then(|| {
            let apart: Vec<f64> = a.iter().zip(&b).map(|(a, b)| b - a).collect();
            mean_and_error2(&apart).1.sqrt() / d
        });
        Some(FgdChange { sampler: row["name"].as_str()?.to_owned(), reference: d, change: (new - d) / d, error })
    };
    generated(other).filter_map(pair).collect()
}

/// The first evaluation that is of other clips or windows than the first one.
fn odd_one(values: &[Value]) -> Option<usize> {
    values.iter().position(|v| ["clips", "windows"].iter().any(|key| v[key] != values[0][key]))
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

/// Rows of motion that the model made with free gaze; the others are the same for all bundles, or
/// not of them.
fn generated(evaluation: &Value) -> impl Iterator<Item = &Value> {
    let rows = evaluation["rows"].as_array().into_iter().flatten();
    rows.filter(|row| row["gaze_target"].is_null() && row["model"] == true)
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
        let batches = [0.8 * fgd, 1.2 * fgd];
        json!({"rows": [
            {"name": "corpus", "gaze_target": null, "model": false, "all": {"fgd": 0.0}},
            {"name": "midpoint4", "gaze_target": null, "model": true, "all": {"fgd": fgd, "fgd_batches": batches, "seam": 1.1}, "wrist_ratio": null},
            {"name": "midpoint4, gaze 0.5", "gaze_target": 0.5, "model": true, "all": {"fgd": 9.0}},
            {"name": "single", "gaze_target": null, "model": true, "all": {"fgd": 2.0 - fgd}},
        ], "reconstruction": {"mm": 12.5}})
    }

    #[test]
    fn metrics_stand_side_by_side() {
        let files = ["f16", "i8", "seed"].map(str::to_owned).to_vec();
        let judged = Judged::of(files, &[evaluation(0.5), evaluation(0.51), evaluation(0.4)], true);
        let names: Vec<_> = judged.metrics.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["midpoint4: all: fgd", "midpoint4: all: seam", "single: all: fgd", "reconstruction: mm"]);
        assert_eq!(judged.metrics[0].1, [Some(0.5), Some(0.51), Some(0.4)]);
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        let [midpoint, single] = judged.fgd[0].as_slice() else { panic!("two samplers: {judged:?}") };
        assert_eq!((midpoint.sampler.as_str(), single.sampler.as_str()), ("midpoint4", "single"));
        close(midpoint.change, 0.02);
        // Batches differ by 0.008 and 0.012: a standard error of 0.002, of a distance of 0.5.
        close(midpoint.error.unwrap(), 0.004);
        close(single.change, -0.01 / 1.5);
        assert_eq!(single.error, None, "no batches");
        close(judged.worst(0).unwrap(), 0.02);
        let chance = judged.chance.as_ref().unwrap();
        assert!(judged.fgd.len() == 1 && judged.worst(1).is_none());
        close(chance[0].change, -0.2);
    }

    #[test]
    fn other_windows_are_refused() {
        let of = |clips: usize, windows: [usize; 2]| json!({"rows": [], "clips": clips, "windows": windows});
        let first = of(1, [8, 2]);
        assert_eq!(odd_one(&[first.clone(), first.clone(), first.clone()]), None);
        assert_eq!(odd_one(&[first.clone(), first.clone(), of(1, [9, 2])]), Some(2));
        assert_eq!(odd_one(&[first.clone(), of(2, [8, 2]), first]), Some(1));
    }
}
