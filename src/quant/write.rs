//! Putting a quantised bundle together.

use super::layers::Layer;
use crate::bundle::{BundleFile, Entry, StoredData, StoredWeights, assemble, failed};
use crate::config::Quantisation;
use crate::error::Result;
use crate::kernels::{I4_GROUP, Scheme};
use safetensors::Dtype;
use std::collections::BTreeMap;

/// Puts weights in the place of those of `file` and records their schemes in its config.
pub(super) fn bundle(file: &BundleFile<'_>, weights: &[(&Layer, StoredWeights)], asked: Scheme) -> Result<Vec<u8>> {
    let (json, tensors) = file.raw()?;
    let mut entries: Vec<Entry> = Vec::new();
    let mut record = Quantisation { scheme: asked, tensors: BTreeMap::new() };
    for (layer, stored) in weights {
        record.tensors.insert(format!("{}.weight", layer.name), stored.scheme());
        store(layer, stored, &mut entries);
    }
    let kept = tensors.iter().filter(|(name, _)| !record.tensors.contains_key(*name));
    entries.extend(kept.map(|(n, v)| (n.to_owned(), v.dtype(), v.shape().to_vec(), v.data().to_vec())));

    let mut config: serde_json::Value = serde_json::from_str(&json).map_err(failed)?;
    config["quantisation"] = serde_json::to_value(&record).map_err(failed)?;
    assemble(&config, &entries)
}

fn store(layer: &Layer, weights: &StoredWeights, entries: &mut Vec<Entry>) {
    let (weight, scale) = (format!("{}.weight", layer.name), format!("{}.scale", layer.name));
    let floats = |w: &[f32]| w.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let halves = |w: &[half::f16]| w.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let shape = layer.shape.clone();
    match &weights.data {
        StoredData::F32(w) => entries.push((weight, Dtype::F32, shape, floats(w))),
        StoredData::F16(w) => entries.push((weight, Dtype::F16, shape, halves(w))),
        StoredData::I8 { q, scale: s } => {
            entries.push((weight, Dtype::I8, shape, q.iter().map(|&v| v as u8).collect()));
            entries.push((scale, Dtype::F32, vec![weights.rows], floats(s)));
        }
        StoredData::I4 { q, scale: s } => {
            entries.push((weight, Dtype::U8, vec![weights.rows, weights.cols.div_ceil(2)], q.clone()));
            entries.push((scale, Dtype::F16, vec![weights.rows, weights.cols.div_ceil(I4_GROUP)], halves(s)));
        }
    }
}
