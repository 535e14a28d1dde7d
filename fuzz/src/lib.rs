//! What the fuzz targets share: the smallest bundle that runs, and taking bundles apart.

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, OnceLock};
use visavis::bundle::CONFIG_KEY;
use visavis::engine::Engine;

/// The bundle of the tests: the real networks with few channels and random weights.
pub const TINY: &[u8] = include_bytes!("../../tests/goldens/tiny.safetensors");

/// A bundle taken apart.
#[derive(Clone)]
pub struct Parts {
    pub config: serde_json::Value,
    pub tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
}

impl Parts {
    /// Takes [`TINY`] apart.
    fn tiny() -> Self {
        let (_, header) = SafeTensors::read_metadata(TINY).expect("the tiny bundle");
        let config = &header.metadata().as_ref().expect("metadata")[CONFIG_KEY];
        let file = SafeTensors::deserialize(TINY).expect("the tiny bundle");
        let tensors = file.iter().map(|(n, v)| (n.to_owned(), (v.dtype(), v.shape().to_vec(), v.data().to_vec())));
        Self { config: serde_json::from_str(config).expect("a config"), tensors: tensors.collect() }
    }

    /// A sound container; `None` when a tensor's data do not fit its shape.
    pub fn bytes(&self) -> Option<Vec<u8>> {
        let views = self.tensors.iter().map(|(n, (dtype, shape, data))| {
            Some((n.as_str(), TensorView::new(*dtype, shape.clone(), data).ok()?))
        });
        let views: Vec<_> = views.collect::<Option<_>>()?;
        let metadata = HashMap::from([(CONFIG_KEY.to_owned(), self.config.to_string())]);
        safetensors::serialize(views, Some(metadata)).ok()
    }
}

/// A bundle that costs little: the tiny one with one layer a network, windows of two blocks and an idle clip of one.
pub fn small() -> &'static Parts {
    static PARTS: OnceLock<Parts> = OnceLock::new();
    PARTS.get_or_init(make_small)
}

/// [`small`] as a file.
pub fn small_bundle() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| small().bytes().expect("a container"))
}

/// The engine of [`small`], loaded once.
pub fn engine() -> Arc<Engine> {
    static ENGINE: OnceLock<Arc<Engine>> = OnceLock::new();
    Arc::clone(ENGINE.get_or_init(|| Engine::from_slice(small_bundle(), "small").expect("the small bundle loads")))
}

fn make_small() -> Parts {
    let mut parts = Parts::tiny();
    let config = &mut parts.config;
    for network in ["vae", "flow"] {
        config[network]["layers"] = 1.into();
        config[network]["window_blocks"] = 2.into();
    }
    config["session"]["anchor_period"] = 3.into();
    // Layer 0 is kept.
    let deep = |name: &str| name.contains(".layers.") && !name.contains(".layers.0.");
    parts.tensors.retain(|name, _| name.starts_with("audio.") || !deep(name));
    if let Some((_, shape, data)) = parts.tensors.get_mut("idle.frames") {
        let row = data.len() / shape[0];
        shape[0] = 4;
        data.truncate(4 * row);
    }
    parts
}
