//! A bundle's file put together anew.

use super::{BundleFile, CONFIG_KEY, StoredData, StoredWeights};
use crate::config::Config;
use crate::error::{Error, ErrorKind, Result};
use crate::kernels::I4_GROUP;
use half::f16;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use std::collections::HashMap;

/// A tensor's name, type, shape and bytes.
pub(crate) type Entry = (String, Dtype, Vec<usize>, Vec<u8>);

/// The bytes of a bundle of these tensors. Same config and tensors, same bytes.
pub(crate) fn assemble(config: &serde_json::Value, entries: &[Entry]) -> Result<Vec<u8>> {
    let views = (entries.iter())
        .map(|(name, dtype, shape, data)| Ok((name.as_str(), TensorView::new(*dtype, shape.clone(), data)?)))
        .collect::<std::result::Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(failed)?;
    // One entry of metadata: a map of more would be written in no fixed order.
    let metadata = HashMap::from([(CONFIG_KEY.to_owned(), config.to_string())]);
    safetensors::serialize(views, Some(metadata)).map_err(failed)
}

/// The tensors of layer `name`: its weights, of shape `shape` where they are not packed, and their
/// scales.
pub(crate) fn entries(name: &str, shape: &[usize], weights: &StoredWeights) -> Vec<Entry> {
    let (weight, scale) = (format!("{name}.weight"), format!("{name}.scale"));
    let halves = |w: &[f16]| w.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let shape = shape.to_vec();
    match &weights.data {
        StoredData::F32(w) => vec![(weight, Dtype::F32, shape, floats(w))],
        StoredData::F16(w) => vec![(weight, Dtype::F16, shape, halves(w))],
        StoredData::I8 { q, scale: s } => vec![
            (weight, Dtype::I8, shape, q.iter().map(|&v| v as u8).collect()),
            (scale, Dtype::F32, vec![weights.rows], floats(s)),
        ],
        StoredData::I4 { q, scale: s } => vec![
            (weight, Dtype::U8, vec![weights.rows, weights.cols.div_ceil(2)], q.clone()),
            (scale, Dtype::F16, vec![weights.rows, weights.cols.div_ceil(I4_GROUP)], halves(s)),
        ],
    }
}

/// Little-endian bytes.
pub(crate) fn floats(w: &[f32]) -> Vec<u8> {
    w.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// [`ErrorKind::BundleInvalid`] for whatever keeps a bundle from being written anew.
pub(crate) fn failed(what: impl std::fmt::Display) -> Error {
    Error::new(ErrorKind::BundleInvalid, format!("cannot be written anew: {what}"))
}

impl BundleFile<'_> {
    /// The bytes of this bundle with the defaults for sessions, the student's settings and the
    /// calibration of gaze and rest of `settings`; all else stays.
    ///
    /// # Errors
    /// [`ErrorKind::BundleCorrupt`] or [`ErrorKind::BundleInvalid`].
    pub fn with_settings(&self, settings: &Config) -> Result<Vec<u8>> {
        let (json, tensors) = self.raw()?;
        let mut config: serde_json::Value = serde_json::from_str(&json).map_err(failed)?;
        let settings = serde_json::to_value(settings).map_err(failed)?;
        for key in ["session", "student", "gaze", "rest"] {
            match settings.get(key) {
                Some(value) => config[key] = value.clone(),
                None => drop(config.as_object_mut().and_then(|config| config.remove(key))),
            }
        }
        let entries = tensors.iter().map(|(n, v)| (n.to_owned(), v.dtype(), v.shape().to_vec(), v.data().to_vec()));
        assemble(&config, &entries.collect::<Vec<_>>())
    }
}
