//! What the fuzz targets share: the smallest bundles that run, and taking bundles apart.

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, OnceLock};
use visavis::internals::bundle::CONFIG_KEY;
use visavis::internals::kernels::Kernels;
use visavis::internals::pose::feature_count;
use visavis::{BundleFile, Engine, Networks};

/// The bundle of the tests with hearing: the real networks with few channels and random weights.
pub const TINY: &[u8] = include_bytes!("../../tests/goldens/hearing.safetensors");

/// Those of the featherweight tier, with dilated convolutions and with LSTM; the rig is [`TINY`]'s.
pub const DRAM: [&[u8]; 2] = [
    include_bytes!("../../tests/goldens/dram-tcn.safetensors"),
    include_bytes!("../../tests/goldens/dram-lstm.safetensors"),
];

/// A bundle taken apart.
#[derive(Clone)]
pub struct Parts {
    pub config: serde_json::Value,
    pub tensors: BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>,
}

impl Parts {
    /// Takes a bundle of the tests apart.
    fn of(bundle: &[u8]) -> Self {
        let (_, header) = SafeTensors::read_metadata(bundle).expect("a sound bundle");
        let config = &header.metadata().as_ref().expect("metadata")[CONFIG_KEY];
        let file = SafeTensors::deserialize(bundle).expect("a sound bundle");
        let tensors = file.iter().map(|(n, v)| (n.to_owned(), (v.dtype(), v.shape().to_vec(), v.data().to_vec())));
        Self { config: serde_json::from_str(config).expect("a config"), tensors: tensors.collect() }
    }

    /// A sound container; `None` when a tensor's data do not fit its shape.
    pub fn bytes(&self) -> Option<Vec<u8>> {
        let views = self
            .tensors
            .iter()
            .map(|(n, (dtype, shape, data))| Some((n.as_str(), TensorView::new(*dtype, shape.clone(), data).ok()?)));
        let views: Vec<_> = views.collect::<Option<_>>()?;
        let metadata = HashMap::from([(CONFIG_KEY.to_owned(), self.config.to_string())]);
        safetensors::serialize(views, Some(metadata)).ok()
    }
}

/// Joints of the small bundle: those that a rig needs, and legs for the stance.
const JOINTS: [&str; 10] = [
    "hips",
    "head",
    "leftHand",
    "rightHand",
    "leftUpperLeg",
    "leftLowerLeg",
    "leftFoot",
    "rightUpperLeg",
    "rightLowerLeg",
    "rightFoot",
];

/// A bundle that costs little: the tiny one with ten joints, one layer a network, windows of two
/// blocks and an idle clip of one.
pub fn small() -> &'static Parts {
    static PARTS: OnceLock<Parts> = OnceLock::new();
    PARTS.get_or_init(make_small)
}

/// Bundles of every kind that sessions have: [`small`], and [`DRAM`].
pub fn kinds() -> &'static [Parts; 3] {
    static PARTS: OnceLock<[Parts; 3]> = OnceLock::new();
    PARTS.get_or_init(|| [small().clone(), Parts::of(DRAM[0]), Parts::of(DRAM[1])])
}

/// [`small`] as a file.
pub fn small_bundle() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| small().bytes().expect("a container"))
}

/// Writes [`small`] to the seeds of the target that takes bundles as files.
pub fn seed_small() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/corpus/bundle_bytes");
    // Without the folder, as where one input is replayed elsewhere, nobody misses the seed.
    let _ = std::fs::write(format!("{folder}/small"), small_bundle());
}

/// The engine of [`small`], loaded once.
pub fn engine() -> Arc<Engine> {
    static ENGINE: OnceLock<Arc<Engine>> = OnceLock::new();
    Arc::clone(ENGINE.get_or_init(|| Engine::from_slice(small_bundle(), "small").expect("the small bundle loads")))
}

/// The same with the student alone, whose sessions start and compute in a fraction of the time.
pub fn student() -> Arc<Engine> {
    static ENGINE: OnceLock<Arc<Engine>> = OnceLock::new();
    Arc::clone(ENGINE.get_or_init(|| {
        let file = BundleFile::from_slice(small_bundle(), "small");
        let networks = Networks { reference: false, ..Networks::default() };
        let kernels = Kernels::detect().expect("a level");
        Engine::from_file_with(&file, kernels, networks).expect("the small bundle loads")
    }))
}

/// The engines of [`DRAM`].
pub fn light(lstm: bool) -> Arc<Engine> {
    static ENGINES: [OnceLock<Arc<Engine>>; 2] = [const { OnceLock::new() }; 2];
    let i = usize::from(lstm);
    Arc::clone(ENGINES[i].get_or_init(|| Engine::from_slice(DRAM[i], "light").expect("the bundle loads")))
}

/// The engine of [`TINY`] with the student alone, which may step down to [`light`].
pub fn tiny() -> Arc<Engine> {
    let file = BundleFile::from_slice(TINY, "tiny");
    let networks = Networks { reference: false, ..Networks::default() };
    Engine::from_file_with(&file, Kernels::detect().expect("a level"), networks).expect("the tiny bundle loads")
}

fn make_small() -> Parts {
    let mut parts = Parts::of(TINY);
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
    fewer_joints(&mut parts);
    parts
}

/// Leaves [`JOINTS`], and of everything that is as wide as the features so much as they need: the
/// weights are random anyway.
fn fewer_joints(parts: &mut Parts) {
    let joints = parts.config["rig"]["joints"].as_array_mut().expect("joints");
    let wide = feature_count(joints.len());
    joints.retain(|joint| JOINTS.iter().any(|name| joint["name"] == *name));
    let narrow = feature_count(joints.len());
    // A limb's joints follow each other; whatever else comes hangs on the hips.
    for j in 1..joints.len() {
        let limb = joints[j]["name"].as_str().is_some_and(|name| name.ends_with("LowerLeg") || name.ends_with("Foot"));
        joints[j]["parent"] = if limb { j - 1 } else { 0 }.into();
    }
    for (_, shape, data) in parts.tensors.values_mut() {
        if shape.first() == Some(&wide) {
            data.truncate(data.len() / wide * narrow);
            shape[0] = narrow;
        } else if shape.last() == Some(&wide) {
            let size = data.len() / shape.iter().product::<usize>();
            *data = data.chunks_exact(wide * size).flat_map(|row| &row[..narrow * size]).copied().collect();
            *shape.last_mut().expect("an axis") = narrow;
        }
    }
}
