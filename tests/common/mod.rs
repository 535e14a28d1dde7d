//! What the integration tests share: the tiny bundle, its goldens, and conversations to drive a
//! session with.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use glam::Vec3;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use visavis::internals::kernels::Scheme;
use visavis::internals::quant::{Options, quantise};
use visavis::{BLOCK_FRAMES, BundleFile, Engine, FPS, Frame, Session, SessionOptions};

/// A file of `tests/goldens`, in the folder of the package that is tested or the one above it.
pub fn golden_path(name: &str) -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = package.ancestors().map(|folder| folder.join("tests/goldens"));
    folders.find(|folder| folder.is_dir()).expect("the folder of goldens").join(name)
}

/// The tiny bundle: the real networks with few channels and random weights.
pub fn tiny() -> Arc<Engine> {
    Engine::load(golden_path("tiny.safetensors")).expect("the tiny bundle loads")
}

/// The tiny bundle of the featherweight tier with the backbone `tcn` or `lstm`.
pub fn dram(backbone: &str) -> Arc<Engine> {
    Engine::load(golden_path(&format!("dram-{backbone}.safetensors"))).expect("the tiny bundle loads")
}

/// The same with all matrices at `scheme` that can be.
pub fn dram_in(backbone: &str, scheme: Scheme) -> Arc<Engine> {
    let file = widened(&read(&format!("dram-{backbone}.safetensors")));
    let options = Options { scheme, smallest: 0, keep: &[], calibration: None, budget: None };
    let quantised = quantise(&file, &options).expect("it can be quantised");
    Engine::from_bytes(quantised.bytes, "tiny").expect("the result loads")
}

/// The tiny bundle in f32, with weights that f16 does not hold.
pub fn tiny_f32() -> BundleFile<'static> {
    widened(&read("tiny.safetensors"))
}

fn read(name: &str) -> Vec<u8> {
    std::fs::read(golden_path(name)).expect("the bundle is there")
}

/// A bundle of half floats in f32, with weights that f16 does not hold.
fn widened(bytes: &[u8]) -> BundleFile<'static> {
    let (_, header) = SafeTensors::read_metadata(bytes).expect("a header");
    let file = SafeTensors::deserialize(bytes).expect("a sound container");
    let widen = |view: &TensorView<'_>| -> Vec<u8> {
        if view.dtype() == Dtype::F32 {
            return view.data().to_vec();
        }
        let halves = view.data().chunks_exact(2).map(|b| half::f16::from_le_bytes([b[0], b[1]]).to_f32());
        halves.flat_map(|v| (v * 1.0001).to_le_bytes()).collect()
    };
    let wide: Vec<_> = file.iter().map(|(name, view)| (name.to_owned(), view.shape().to_vec(), widen(&view))).collect();
    let views = wide.iter().map(|(name, shape, data)| {
        (name.as_str(), TensorView::new(Dtype::F32, shape.clone(), data).expect("a sound tensor"))
    });
    let bytes = safetensors::serialize(views, header.metadata().clone()).expect("a bundle");
    BundleFile::from_bytes(bytes, "tiny f32")
}

/// The tiny bundle with all matrices at `scheme` that can be.
pub fn tiny_in(scheme: Scheme) -> Arc<Engine> {
    let file = tiny_f32();
    let options = Options { scheme, smallest: 0, keep: &[], calibration: None, budget: None };
    let quantised = quantise(&file, &options).expect("it can be quantised");
    Engine::from_bytes(quantised.bytes, "tiny").expect("the result loads")
}

/// What PyTorch computed from the tiny bundle (`training/visavis_train/goldens.py`).
pub struct Golden(Vec<u8>);

impl Golden {
    pub fn load() -> Self {
        Self::named("tiny-golden.safetensors")
    }

    pub fn named(name: &str) -> Self {
        Self(std::fs::read(golden_path(name)).expect("the golden file is there"))
    }

    /// A tensor's shape and values; i16 audio is scaled to 1.
    pub fn get(&self, name: &str) -> (Vec<usize>, Vec<f32>) {
        let all = SafeTensors::deserialize(&self.0).expect("the golden file is sound");
        let view = all.tensor(name).unwrap_or_else(|_| panic!("the golden file has {name}"));
        let data = view.data();
        let values = match view.dtype() {
            Dtype::F32 => data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
            Dtype::I16 => data.chunks_exact(2).map(|b| f32::from(i16::from_le_bytes([b[0], b[1]])) / 32768.0).collect(),
            Dtype::I32 => data.chunks_exact(4).map(|b| i32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32).collect(),
            other => panic!("{name} is {other:?}"),
        };
        (view.shape().to_vec(), values)
    }

    pub fn values(&self, name: &str) -> Vec<f32> {
        self.get(name).1
    }
}

/// Largest absolute difference; both must have the same length.
pub fn max_error(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Inputs of a conversation.
#[derive(Clone)]
pub struct Inputs {
    pub agent: Vec<f32>,
    pub user: Vec<f32>,
    pub rate: u32,
    pub path: Vec<(f64, Vec3)>,
}

impl Inputs {
    /// Two syllable-like voices taking turns and a user who walks around the agent, `seconds` long;
    /// the same bits on every machine.
    pub fn circling(seconds: f64, rate: u32) -> Self {
        let n = (seconds * f64::from(rate)) as usize;
        let voice = |pitch: f64, turn: f64| -> Vec<f32> {
            (0..n)
                .map(|i| {
                    let t = i as f64 / f64::from(rate);
                    let speaks = (t / 3.0 + turn).rem_euclid(2.0) < 1.0;
                    let level = libm::sin(std::f64::consts::TAU * 3.7 * t).max(0.0).powi(2);
                    let tone: f64 = (1..8)
                        .map(|h| libm::sin(std::f64::consts::TAU * pitch * f64::from(h) * t) / f64::from(h))
                        .sum();
                    if speaks { (0.2 * level * tone) as f32 } else { 0.0 }
                })
                .collect()
        };
        let path = (0..(seconds * 90.0) as usize)
            .map(|i| {
                let t = i as f64 / 90.0;
                let a = 0.5 * t;
                (t, Vec3::new((1.7 * libm::sin(a)) as f32, 1.65, (1.7 * libm::cos(a)) as f32))
            })
            .collect();
        Self { agent: voice(120.0, 0.0), user: voice(190.0, 1.0), rate, path }
    }
}

/// Pushes everything at once, then polls `blocks` blocks.
pub fn run(session: &mut Session, inputs: &Inputs, blocks: usize) -> Vec<Frame> {
    if !inputs.agent.is_empty() {
        session.push_agent_audio(&inputs.agent, inputs.rate).expect("agent audio");
    }
    if !inputs.user.is_empty() {
        session.push_user_audio(&inputs.user, inputs.rate).expect("user audio");
    }
    for (time, position) in &inputs.path {
        session.push_user_head(*position, *time).expect("head");
    }
    poll_blocks(session, blocks)
}

/// Polls until `blocks` blocks have come.
pub fn poll_blocks(session: &mut Session, blocks: usize) -> Vec<Frame> {
    let mut frames = Vec::new();
    for _ in 0..blocks {
        let now = session.next_due();
        frames.extend_from_slice(session.poll(now).expect("poll").expect("a block is due"));
    }
    frames
}

/// A session of the tiny engine over `inputs`.
pub fn motion(options: SessionOptions, inputs: &Inputs, blocks: usize) -> Vec<Frame> {
    motion_of(&tiny(), options, inputs, blocks)
}

/// A session of `engine` over `inputs`.
pub fn motion_of(engine: &Arc<Engine>, options: SessionOptions, inputs: &Inputs, blocks: usize) -> Vec<Frame> {
    run(&mut engine.session(options).expect("session"), inputs, blocks)
}

/// Seconds of `blocks` blocks.
pub fn block_seconds(blocks: usize) -> f64 {
    (blocks * BLOCK_FRAMES) as f64 / f64::from(FPS)
}

/// Features of the hearing of [`hearing_bytes`], and the width of its embedding.
pub const HEARING: (usize, usize) = (6, 8);
/// Width and reactions of its appraisal.
pub const APPRAISAL: (usize, usize) = (8, 3);
/// What a frame of its sound vector has: features and shares of the reactions.
pub const TOLD: usize = HEARING.0 + APPRAISAL.1;

/// The tiny bundle with hearing of random weights; all else is the tiny bundle's.
pub fn hearing_bytes() -> Vec<u8> {
    guided_hearing_bytes(1.0)
}

/// The same, with guidance that goes `guidance` times as far while it reacts.
pub fn guided_hearing_bytes(guidance: f32) -> Vec<u8> {
    with_hearing(&read("tiny.safetensors"), guidance)
}

/// An engine of [`hearing_bytes`].
pub fn hearing() -> Arc<Engine> {
    Engine::from_bytes(hearing_bytes(), "tiny with hearing").expect("it loads")
}

/// The same in f32.
pub fn hearing_f32() -> BundleFile<'static> {
    widened(&hearing_bytes())
}

/// That with all matrices at `scheme` that can be.
pub fn hearing_in(scheme: Scheme) -> Arc<Engine> {
    let options = Options { scheme, smallest: 0, keep: &[], calibration: None, budget: None };
    let quantised = quantise(&hearing_f32(), &options).expect("it can be quantised");
    Engine::from_bytes(quantised.bytes, "tiny with hearing").expect("the result loads")
}

/// A bundle with hearing, of random weights, put into one without.
fn with_hearing(bytes: &[u8], guidance: f32) -> Vec<u8> {
    let (_, header) = SafeTensors::read_metadata(bytes).expect("a header");
    let file = SafeTensors::deserialize(bytes).expect("a sound container");
    let mut metadata = header.metadata().clone().expect("metadata");
    let mut config: serde_json::Value = serde_json::from_str(&metadata["visavis"]).expect("a config");
    let (features, embed) = HEARING;
    let shapes = [(1, 4, 10, 5), (4, 6, 10, 5), (6, 8, 8, 4), (8, 8, 8, 4), (8, 8, 4, 2), (8, 8, 3, 1)];
    let layers: Vec<_> = shapes
        .iter()
        .map(|(inputs, outputs, kernel, stride)| {
            serde_json::json!({"inputs": inputs, "outputs": outputs, "kernel": kernel, "stride": stride, "residual": *stride == 1})
        })
        .collect();
    let (cells, reactions) = APPRAISAL;
    let names: Vec<_> =
        (0..reactions).map(|i| if i == 0 { "stay".to_owned() } else { format!("reaction {i}") }).collect();
    let appraisal = serde_json::json!({"width": cells, "reactions": names});
    config["hearing"] = serde_json::json!(
        {"audio": {"layers": layers, "features": features}, "embed": embed, "appraisal": appraisal, "guidance": guidance});
    metadata.insert("visavis".to_owned(), config.to_string());
    let width = config["flow"]["width"].as_u64().expect("a width") as usize;

    let mut added: Vec<(String, Vec<usize>)> = Vec::new();
    let mut layer = |name: String, shape: Vec<usize>, bias: bool| {
        if bias {
            added.push((format!("{name}.bias"), vec![shape[0]]));
        }
        added.push((format!("{name}.weight"), shape));
    };
    for (i, (inputs, outputs, kernel, _)) in shapes.into_iter().enumerate() {
        layer(format!("hearing.conv.{i}"), vec![outputs, kernel, inputs], true);
    }
    layer("hearing.out".to_owned(), vec![features, 8], true);
    layer("appraisal.into".to_owned(), vec![cells, features + 3], true);
    layer("appraisal.lstm".to_owned(), vec![4 * cells, 2 * cells], true);
    layer("appraisal.out".to_owned(), vec![reactions, cells], true);
    for net in ["flow", "student"] {
        layer(format!("{net}.embed_sound.0"), vec![embed, 4 * TOLD + 14], true);
        layer(format!("{net}.embed_sound.2"), vec![embed, embed], true);
        layer(format!("{net}.input_sound"), vec![width, embed + 1], false);
    }
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut all: Vec<_> =
        file.iter().map(|(n, v)| (n.to_owned(), v.dtype(), v.shape().to_vec(), v.data().to_vec())).collect();
    for (name, shape) in added {
        let inputs = shape[1..].iter().product::<usize>().max(1);
        let scale = if name.ends_with("bias") { 0.1 } else { 1.7 / (inputs as f32).sqrt() };
        let count = shape.iter().product::<usize>();
        let data: Vec<_> = (0..count).flat_map(|_| (scale * unit()).to_le_bytes()).collect();
        all.push((name, Dtype::F32, shape, data));
    }
    let views = all.iter().map(|(name, dtype, shape, data)| {
        (name.as_str(), TensorView::new(*dtype, shape.clone(), data).expect("a sound tensor"))
    });
    safetensors::serialize(views, Some(metadata)).expect("a bundle")
}

/// Noise of a seed within +-`loud`.
pub fn noise(seed: u64, samples: usize, loud: f32) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut unit = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..samples).map(|_| loud * unit()).collect()
}
