//! From sources to what a block is told of them.

use super::SoundStats;
use super::appraisal::{Appraisal, AppraisalWeights};
use super::head::{Head, level};
use super::input::SoundInput;
use super::sources::Sources;
use crate::audio::{AudioEncoder, AudioWeights};
use crate::bundle::{AudioSource, Tensors};
use crate::config::HearingConfig;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FRAME_SAMPLES, Root, Transform};
use crate::kernels::{Exec, Kernels};
use glam::Vec3;

/// Level at an ear that is 0 to the network, and dB that are 1.
const MIDDLE: f64 = 60.0;
const UNIT: f64 = 20.0;
/// Silence that the encoder has heard before it begins: more than it remembers.
const WARM_BLOCKS: usize = 4;
/// Where the encoder's input bends, pascals.
const SQUASH: f32 = 0.2;

/// Weights of what hears the room, which all sessions share.
#[derive(Debug)]
pub struct HearingWeights {
    /// Encoder of what both ears hear.
    pub audio: AudioWeights,
    /// What is made of it.
    pub appraisal: AppraisalWeights,
    /// What the encoder remembers of silence, which every session begins with.
    quiet: Vec<f32>,
}

impl HearingWeights {
    /// Reads `hearing.*` and `appraisal.*`. The encoder hears silence on `exec`, whose width is at
    /// least its own.
    ///
    /// # Errors
    /// As [`AudioSource::load`] and [`Tensors::linear`].
    pub fn load(t: &Tensors<'_>, kernels: Kernels, exec: &mut Exec, config: &HearingConfig) -> Result<Self> {
        let audio = AudioSource::load(t, &config.audio, "hearing")?.pack(kernels, &config.audio)?;
        let appraisal = AppraisalWeights::load(t, kernels, config)?;
        let mut encoder = AudioEncoder::new(&config.audio)?;
        let (silence, mut features) = ([0.0; BLOCK_SAMPLES], vec![0.0; BLOCK_FRAMES * config.audio.features]);
        exec.begin();
        (0..WARM_BLOCKS).for_each(|_| encoder.encode(exec, &audio, &silence, &mut features));
        exec.end();
        Ok(Self { audio, appraisal, quiet: encoder.context() })
    }

    /// Bytes of all packed weights.
    pub fn bytes(&self) -> usize {
        self.audio.bytes() + self.appraisal.bytes()
    }
}

/// One session's hearing. Allocates when made and never after.
pub struct Hearing {
    sources: Sources,
    encoder: AudioEncoder,
    height: f64,
    ears: Box<[[f32; BLOCK_SAMPLES]; 2]>,
    /// What the encoder hears.
    mixed: Box<[f32; BLOCK_SAMPLES]>,
    /// `[4, features]`.
    features: Vec<f32>,
    appraisal: Appraisal,
    /// Length of `vector` in front of the levels.
    told: usize,
    /// `[S]`.
    vector: Vec<f32>,
    /// Whether there was anything to listen to in the block before.
    open: bool,
    /// Whether the block that was listened to last was heard.
    heard: bool,
}

impl Hearing {
    /// Takes all memory: 32 streams of ten seconds. The head's centre is `height` metres over the
    /// head joint, along the head.
    ///
    /// # Errors
    /// As [`AudioEncoder::new`].
    pub fn new(config: &HearingConfig, height: f32) -> Result<Self> {
        Ok(Self {
            sources: Sources::new(),
            encoder: AudioEncoder::new(&config.audio)?,
            height: f64::from(height),
            ears: Box::new([[0.0; BLOCK_SAMPLES]; 2]),
            mixed: Box::new([0.0; BLOCK_SAMPLES]),
            features: vec![0.0; BLOCK_FRAMES * config.audio.features],
            appraisal: Appraisal::new(config),
            told: BLOCK_FRAMES * config.told(),
            vector: vec![0.0; config.width()],
            open: false,
            heard: false,
        })
    }

    /// The end that is pushed into.
    pub fn input(&self) -> SoundInput {
        self.sources.input()
    }

    /// Takes notice of what was pushed; the agent stands at `root`, and `block` is due.
    pub fn begin(&mut self, block: u64, root: &Root) {
        self.sources.begin(block, [root.x, 1.6, root.z]);
    }

    /// Whether any sound has begun by `block`.
    pub fn has_begun(&self, block: u64) -> bool {
        self.sources.have_begun(block)
    }

    /// Hears what sounded in `block`, in whose frames the head joint was at `heads`.
    pub fn listen(
        &mut self,
        exec: &mut Exec,
        weights: &HearingWeights,
        block: u64,
        heads: &[Transform; BLOCK_FRAMES],
        sensitivity: f32,
    ) {
        let Self { sources, encoder, height, ears, mixed, features, appraisal, told, vector, open, heard } = self;
        *heard = sources.have_begun(block);
        if !*heard {
            return;
        }
        if !std::mem::replace(open, true) {
            encoder.set_context(&weights.quiet);
            appraisal.forget();
        }
        ears.as_flattened_mut().fill(0.0);
        sources.hear(block, &heads.each_ref().map(|joint| Head::new(joint, *height)), ears);
        let [left, right] = &**ears;
        for ((mixed, left), right) in mixed.iter_mut().zip(left).zip(right) {
            let middle = 0.5 * (left + right);
            *mixed = middle / (SQUASH + middle.abs());
        }
        encoder.encode(exec, &weights.audio, &mixed[..], features);
        let (told, rest) = vector.split_at_mut(*told);
        let levels = &mut rest[..2 * BLOCK_FRAMES];
        let frames = left.chunks_exact(FRAME_SAMPLES).zip(right.chunks_exact(FRAME_SAMPLES));
        for (levels, (left, right)) in levels.chunks_exact_mut(2).zip(frames) {
            let scaled = [left, right].map(|ear| ((level(ear) - MIDDLE) / UNIT).clamp(-2.0, 3.5) as f32);
            levels.copy_from_slice(&scaled);
        }
        appraisal.hear(exec, &weights.appraisal, features, levels, sensitivity);
        let (features, shares) = (features.len() / BLOCK_FRAMES, appraisal.shares().len() / BLOCK_FRAMES);
        for (t, told) in told.chunks_exact_mut(features + shares).enumerate() {
            told[..features].copy_from_slice(&self.features[t * features..][..features]);
            told[features..].copy_from_slice(&appraisal.shares()[t * shares..][..shares]);
        }
    }

    /// Lets `block` go by unheard; what is heard next starts a new signal.
    pub fn skip(&mut self, block: u64) {
        (self.open, self.heard) = (false, false);
        self.sources.skip(block);
    }

    /// Whether the last block was listened to, and any sound had begun.
    pub fn has_heard(&self) -> bool {
        self.heard
    }

    /// How much it calls for a reaction, 0 to 1; 0 where nothing was listened to.
    pub fn reaction(&self) -> f32 {
        if self.heard { self.appraisal.reaction() } else { 0.0 }
    }

    /// What the left and the right ear heard of it, `[2, 3200]` pascals.
    pub fn ears(&self) -> &[f32] {
        self.ears.as_flattened()
    }

    /// Its features, `[4, features]`.
    pub fn features(&self) -> &[f32] {
        &self.features
    }

    /// Its sound vector, `[S]`, with the agent's root at its end.
    pub fn vector(&mut self, root: &Root, sensitivity: f32) -> &[f32] {
        let place = self.place().map_or([0.0; 5], |place| {
            let local = root.to_local(place);
            let [x, z] = [local.x, local.z].map(f64::from);
            let rho = (x * x + z * z).sqrt();
            let [sin, cos] = if rho < 1e-3 { [0.0, 1.0] } else { [x / rho, z / rho] };
            let far = libm::log2(rho.max(0.3)) - 1.0;
            [1.0, sin as f32, cos as f32, far as f32, local.y - 1.5]
        });
        let rest = &mut self.vector[self.told + 2 * BLOCK_FRAMES..];
        rest[..5].copy_from_slice(&place);
        rest[5] = sensitivity;
        &self.vector
    }

    /// Where what stood out last is, world metres, while that is known.
    pub fn place(&self) -> Option<Vec3> {
        self.sources.salient().map(|place| Vec3::from(place.map(|v| v as f32)))
    }

    /// Starts anew: nothing was pushed. Waits for pushes that are under way.
    pub fn reset(&mut self) {
        self.sources.reset();
        (self.open, self.heard) = (false, false);
    }

    /// Counters since the start.
    pub fn stats(&self) -> SoundStats {
        self.sources.stats()
    }
}
