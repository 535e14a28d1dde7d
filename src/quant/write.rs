//! Putting a quantised bundle together.

use super::layers::Layer;
use crate::bundle::{self, BundleFile, Entry, StoredWeights, assemble, failed, floats};
use crate::bundle::{IDLE_FRAMES, IDLE_LATENTS};
use crate::config::Quantisation;
use crate::engine::Engine;
use crate::error::Result;
use crate::kernels::Scheme;
use half::f16;
use safetensors::Dtype;
use std::collections::BTreeMap;

/// Puts weights in the place of those of `file` and records their schemes in its config. The idle
/// clip's frames give way to the latents that `reference` made of them. In an f16 bundle all else
/// is f16 too, but for what [`stays`] names.
pub(super) fn bundle(
    file: &BundleFile<'_>,
    reference: Option<&Engine>,
    weights: &[(&Layer, StoredWeights)],
    asked: Scheme,
) -> Result<Vec<u8>> {
    let (json, tensors) = file.raw()?;
    let idle = reference.and_then(|engine| engine.sarah().ok().map(|sarah| (engine, sarah)));
    let mut entries: Vec<Entry> = Vec::new();
    let mut record = Quantisation { scheme: asked, tensors: BTreeMap::new() };
    for (layer, stored) in weights {
        record.tensors.insert(format!("{}.weight", layer.name), stored.scheme());
        entries.extend(bundle::entries(&layer.name, &layer.shape, stored));
    }
    for (name, view) in tensors.iter().filter(|(name, _)| !record.tensors.contains_key(*name)) {
        let shape = view.shape().to_vec();
        let entry = match (name, view.dtype(), idle) {
            (IDLE_FRAMES, _, Some((engine, sarah))) => {
                let shape = vec![engine.idle_blocks(), engine.config().vae.latent];
                (IDLE_LATENTS.to_owned(), Dtype::F32, shape, floats(sarah.idle.values()))
            }
            (_, Dtype::F32, _) if asked == Scheme::F16 && !stays(name, &record) => match narrowed(view.data()) {
                Some(halves) => (name.to_owned(), Dtype::F16, shape, halves),
                None => (name.to_owned(), Dtype::F32, shape, view.data().to_vec()),
            },
            (_, dtype, _) => (name.to_owned(), dtype, shape, view.data().to_vec()),
        };
        entries.push(entry);
    }

    let mut config: serde_json::Value = serde_json::from_str(&json).map_err(failed)?;
    config["quantisation"] = serde_json::to_value(&record).map_err(failed)?;
    assemble(&config, &entries)
}

/// Whether a tensor of floats that is no weight matrix stays f32 in a bundle of halves: statistics,
/// which every pose is scaled by (f16 would round a height of 1.5 m by up to half a millimetre);
/// the decoder's biases, norms and tokens, through which every pose goes (two thousandths of the
/// bundle, and half of its error); latents of the idle clip; and the bias of a layer that is kept
/// at f32.
fn stays(name: &str, record: &Quantisation) -> bool {
    let layer = name.strip_suffix(".bias").map(|layer| format!("{layer}.weight"));
    name.starts_with("stats.")
        || name.starts_with("vae.decoder.")
        || name == IDLE_LATENTS
        || layer.is_some_and(|weight| record.tensors.get(&weight) == Some(&Scheme::F32))
}

/// Little-endian floats as half floats; none when one of them is beyond their range.
fn narrowed(data: &[u8]) -> Option<Vec<u8>> {
    let (values, _) = data.as_chunks::<4>();
    let halves: Vec<f16> = values.iter().map(|b| f16::from_f32(f32::from_le_bytes(*b))).collect();
    halves.iter().all(|h| h.is_finite()).then(|| halves.iter().flat_map(|h| h.to_le_bytes()).collect())
}
