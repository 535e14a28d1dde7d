//! Numbers that depend on the bundles alone, not on the machine: tensors, layer outputs,
//! teacher-forced blocks.

use super::spread::{Spread, cosine, sqnr};
use crate::contents::made_with;
use serde::{Deserialize, Serialize};
use visavis::internals::bundle::StoredWeights;
use visavis::internals::kernels::{Activations, Epilogue, Exec, Kernels, Matrix, Scheme};
use visavis::internals::quant::{Forced, Layer, Scene, Teacher, layers};
use visavis::{BundleFile, Engine, Result};

/// Inputs of each layer that its outputs are compared on, rows.
const ROWS: usize = 96;
/// Seed of the noise: another one than the quantiser's, which rounds for the sample conversation.
const SEED: u64 = 1;

/// One weight matrix against the reference's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TensorRow {
    /// Layer.
    pub name: String,
    /// Its scheme.
    pub scheme: Scheme,
    /// Bits that its activations are rounded to; none where they are floats.
    pub activation_bits: Option<u8>,
    /// Outputs and inputs.
    pub shape: [usize; 2],
    /// Bytes of values and scales in the file.
    pub bytes: usize,
    /// Signal to quantisation noise of the weights, dB; none where they are equal.
    pub sqnr_db: Option<f64>,
    /// Largest difference of a weight.
    pub max_error: f64,
    /// Outputs on inputs of the sample conversation; none for layers that a block does not run.
    pub output: Option<LayerOutput>,
}

/// A layer's outputs on real inputs against the reference's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LayerOutput {
    /// Rows of inputs.
    pub rows: usize,
    /// Cosine of the angle between all outputs.
    pub cosine: f64,
    /// Signal to noise, dB; none where they are equal.
    pub sqnr_db: Option<f64>,
}

/// Teacher-forced blocks of one sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Blocks {
    /// The sampler (of bundles without any, their kind), and whether the voices were exchanged.
    pub sampler: String,
    /// Frames compared.
    pub frames: usize,
    /// Joint positions, millimetres, over all joints.
    pub mm: Spread,
    /// Joint rotations, degrees.
    pub degrees: Spread,
    /// The gaze score.
    pub gaze: Spread,
    /// Signal to noise of the latents, dB; of the kind `dram` of the poses.
    pub latent_sqnr_db: Option<f64>,
    /// Positions after encoder and decoder, of the reference's motion, millimetres; none of bundles
    /// that have none.
    pub round_trip_mm: Option<Spread>,
    /// By joint.
    pub joints: Vec<JointRow>,
    /// Hash of the candidate's latents or poses: the same bits give the same number on any machine.
    pub bits: String,
}

/// One joint of [`Blocks`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointRow {
    /// Name.
    pub joint: String,
    /// Position, millimetres.
    pub mm: Spread,
    /// Rotation, degrees.
    pub degrees: Spread,
}

/// All of it for one candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CandidateNumerics {
    /// File name.
    pub name: String,
    /// Weight matrices.
    pub tensors: Vec<TensorRow>,
    /// Teacher-forced blocks, a sampler each.
    pub blocks: Vec<Blocks>,
}

/// What `--numerics-only` writes, and `--other-machine` reads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Numerics {
    /// Architecture.
    pub arch: String,
    /// CPU level.
    pub level: String,
    /// Blocks of the sample conversation that were run.
    pub blocks: usize,
    /// Sounds in the room that the bundles heard meanwhile; 0 of bundles without hearing.
    #[serde(default)]
    pub sounds: usize,
    /// The candidates.
    pub candidates: Vec<CandidateNumerics>,
}

/// A bundle, opened and loaded.
pub(super) struct Loaded {
    pub(super) name: String,
    pub(super) file: BundleFile<'static>,
    pub(super) engine: std::sync::Arc<Engine>,
}

/// Measures `candidates` against `reference` over `scene`.
pub(super) fn measure(
    reference: &Loaded,
    candidates: &[Loaded],
    scene: &Scene,
    progress: &dyn Fn(&str),
) -> Result<Numerics> {
    let student = reference.engine.config().student.map(|_| visavis::Sampler::Single);
    let samplers = [Some(visavis::Sampler::Midpoint4), student];
    let mut activations = Some(Activations::new(ROWS, 5));
    let mut teachers = Vec::new();
    for sampler in samplers.into_iter().flatten() {
        for (scene, told) in [(scene.clone(), ""), (scene.exchanged(), ", voices exchanged")] {
            let label = format!("{}{told}", made_with(&reference.engine, sampler));
            progress(&format!("reference, {label}"));
            teachers.push((label, Teacher::new(&reference.engine, scene, sampler, SEED, &mut activations)?));
        }
    }
    let activations = activations.unwrap_or_default();
    let layers = layers(&reference.file.parse()?.1)?;
    let one = |candidate: &Loaded| -> Result<_> {
        progress(&format!("{}: tensors and layers", candidate.name));
        let tensors = tensors(candidate, &layers, &activations)?;
        let mut blocks = Vec::new();
        for (label, teacher) in &teachers {
            progress(&format!("{}: teacher-forced blocks, {label}", candidate.name));
            let forced = teacher.compare(&candidate.engine).map_err(|e| e.with_path(candidate.file.path()))?;
            blocks.push(Blocks::of(label, &forced, &reference.engine));
        }
        Ok(CandidateNumerics { name: candidate.name.clone(), tensors, blocks })
    };
    let kernels = reference.engine.kernels();
    Ok(Numerics {
        arch: std::env::consts::ARCH.to_owned(),
        level: kernels.level().to_string(),
        blocks: scene.blocks(),
        sounds: if reference.engine.has_hearing() {
            scene.sounds().iter().filter(|s| s.block < scene.blocks()).count()
        } else {
            0
        },
        candidates: candidates.iter().map(one).collect::<Result<_>>()?,
    })
}

fn tensors(candidate: &Loaded, layers: &[Layer], activations: &Activations) -> Result<Vec<TensorRow>> {
    let (_, tensors) = candidate.file.parse()?;
    let kernels = candidate.engine.kernels();
    let row = |layer: &Layer| -> Result<_> {
        let stored = tensors.weights(&layer.name, layer.shape[0], &layer.shape[1..])?;
        let (a, b) = (layer.weights.to_f32(), stored.to_f32());
        let x = activations.rows(&layer.name);
        let rows = x.len() / stored.cols;
        let pack = |w: &StoredWeights| w.pack(kernels, &layer.name, None);
        let matrix = pack(&stored);
        let output = (rows > 0).then(|| {
            let (a, b) = (product(&pack(&layer.weights), kernels, x, rows), product(&matrix, kernels, x, rows));
            LayerOutput { rows, cosine: cosine(&a, &b), sqnr_db: sqnr(&a, &b) }
        });
        Ok(TensorRow {
            name: layer.name.clone(),
            scheme: stored.scheme(),
            activation_bits: matrix.activation_bits(),
            shape: [stored.rows, stored.cols],
            bytes: stored.borrow().bytes(),
            sqnr_db: sqnr(&a, &b),
            max_error: a.iter().zip(&b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max),
            output,
        })
    };
    layers.iter().map(row).collect()
}

/// xW' of `rows` rows, without bias.
fn product(w: &Matrix, kernels: Kernels, x: &[f32], rows: usize) -> Vec<f32> {
    let mut y = vec![0.0; rows * w.out_features()];
    // One thread needs nothing from the system, so this does not fail.
    if let Ok(mut exec) = Exec::new(kernels, 1, w.in_features()) {
        exec.linear(w, x, rows, &mut y, Epilogue::Store);
    }
    y
}

impl Blocks {
    fn of(label: &str, forced: &Forced, reference: &Engine) -> Self {
        let frames = &forced.frames;
        let (mm, degrees) = (1000.0, f64::to_degrees(1.0));
        let joint = |(j, joint): (usize, &visavis::Joint)| JointRow {
            joint: joint.name.clone(),
            mm: Spread::of(frames.iter().map(|f| &f.joints[j]), mm),
            degrees: Spread::of(frames.iter().map(|f| &f.angles[j]), degrees),
        };
        let mut hash = 0xcbf2_9ce4_8422_2325u64;
        for v in &forced.latents[1] {
            hash =
                v.to_bits().to_le_bytes().iter().fold(hash, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
        }
        Self {
            sampler: label.to_owned(),
            frames: frames.len(),
            mm: Spread::of(frames.iter().flat_map(|f| &f.joints), mm),
            degrees: Spread::of(frames.iter().flat_map(|f| &f.angles), degrees),
            gaze: Spread::of(frames.iter().filter_map(|f| f.gaze.as_ref()), 1.0),
            latent_sqnr_db: sqnr(&forced.latents[0], &forced.latents[1]),
            round_trip_mm: (!forced.round_trip.is_empty()).then(|| Spread::of(&forced.round_trip, mm)),
            joints: reference.config().rig.joints.iter().enumerate().map(joint).collect(),
            bits: format!("{hash:016x}"),
        }
    }
}
