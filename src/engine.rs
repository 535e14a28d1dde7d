//! The engine: a loaded bundle, immutable, shared by any number of sessions.

#[cfg(feature = "internals")]
mod round_trip;

use crate::audio::{AudioEncoder, AudioWeights};
use crate::bundle::{AudioSource, BundleFile, IDLE_FRAMES, IDLE_LATENTS, LoadMode, Tensors};
use crate::config::Config;
use crate::error::{Error, ErrorKind, Result};
use crate::flow::{ConditionLayout, FlowNet, Nets, reference_times, student_times};
use crate::frame::{BLOCK_FRAMES, Sampler, feature_count};
use crate::kernels::{Exec, Kernels, KvDtype};
use crate::normaliser::{Metric, Normaliser, Standardised};
use crate::rig::Rig;
use crate::vae::{Decoder, Encoder};
use std::path::Path;
use std::sync::Arc;

/// Most frames of an idle clip: every session starts by going through them.
const MAX_IDLE_FRAMES: usize = 3600;

/// Which networks of a bundle an engine holds.
///
/// What no session will use need not take memory, nor time to load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Networks {
    /// The network of the samplers with steps: midpoint and Euler. Without it sessions need
    /// [`Sampler::Single`].
    pub reference: bool,
    /// The student of the single-step sampler, where the bundle has one.
    pub student: bool,
    /// The encoder of motion. Without it sessions do not re-anchor, whatever their options say.
    pub encoder: bool,
    /// The weights that make the modulation of any flow time, a fifth of a flow network. Without
    /// them sessions have the bundle's own flow times: the midpoint rules, [`Sampler::Euler`] with
    /// 1, 2, 4 or 8 steps, and [`Sampler::Single`].
    pub modulation: bool,
}

impl Default for Networks {
    /// All.
    fn default() -> Self {
        Self { reference: true, student: true, encoder: true, modulation: true }
    }
}

/// A loaded model: networks packed for this CPU, rig and statistics.
///
/// Immutable and shared; all that changes is in [`Session`](crate::Session).
///
/// ```no_run
/// # fn main() -> visavis::Result<()> {
/// use visavis::{Engine, SessionOptions};
///
/// let engine = Engine::load("models/visavis-base-i8.safetensors")?;
/// let mut session = engine.session(SessionOptions::default())?;
/// session.push_user_head(visavis::glam::Vec3::new(0.0, 1.6, 1.5), 0.0)?;
/// while let Some(frames) = session.poll(0.0)? {
///     println!("{} joints at {} s", frames[0].global.len(), frames[0].time);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Engine {
    pub(crate) config: Config,
    pub(crate) kernels: Kernels,
    pub(crate) audio: AudioWeights,
    #[cfg(feature = "tract")]
    pub(crate) audio_source: AudioSource,
    pub(crate) encoder: Option<Encoder>,
    pub(crate) decoder: Decoder,
    pub(crate) flow: Option<FlowNet>,
    pub(crate) student: Option<FlowNet>,
    pub(crate) pose: Normaliser,
    pub(crate) latent: Normaliser,
    /// Latents of the idle clip, `[blocks, latent]`.
    pub(crate) idle: Standardised,
}

impl Engine {
    /// Maps and loads the bundle at `path` with the best kernels of this CPU (or those of
    /// `VISAVIS_CPU`).
    ///
    /// # Errors
    /// [`ErrorKind::Io`], [`ErrorKind::BundleCorrupt`], [`ErrorKind::BundleVersion`],
    /// [`ErrorKind::BundleInvalid`], each naming the file; [`ErrorKind::CpuLevel`].
    pub fn load(path: impl AsRef<Path>) -> Result<Arc<Self>> {
        Self::load_with(path, LoadMode::Map)
    }

    /// As [`Engine::load`], mapping the file or copying it first: [`LoadMode`] tells what each of
    /// them survives.
    ///
    /// # Errors
    /// As [`Engine::load`].
    pub fn load_with(path: impl AsRef<Path>, mode: LoadMode) -> Result<Arc<Self>> {
        Self::from_file(&BundleFile::open_with(path, mode)?, Kernels::detect()?)
    }

    /// Loads a bundle from memory; `name` stands for it in errors.
    ///
    /// # Errors
    /// As [`Engine::load`].
    pub fn from_bytes(bytes: Vec<u8>, name: &str) -> Result<Arc<Self>> {
        Self::from_file(&BundleFile::from_bytes(bytes, name), Kernels::detect()?)
    }

    /// As [`Engine::from_bytes`], from memory that stays the caller's.
    ///
    /// # Errors
    /// As [`Engine::load`].
    pub fn from_slice(bytes: &[u8], name: &str) -> Result<Arc<Self>> {
        Self::from_file(&BundleFile::from_slice(bytes, name), Kernels::detect()?)
    }

    /// Loads the bundle that lies in an open file, `length` bytes from `offset` on (`None`: up to
    /// the end), such as an asset that is stored uncompressed in an APK. The descriptor stays the
    /// caller's; its position is neither used nor moved.
    ///
    /// # Errors
    /// As [`Engine::load`]; [`ErrorKind::Argument`] when the file is shorter.
    #[cfg(unix)]
    pub fn from_fd(fd: std::os::fd::BorrowedFd<'_>, offset: u64, length: Option<u64>) -> Result<Arc<Self>> {
        const NAME: &str = "bundle asset";
        let own = fd.try_clone_to_owned().map_err(|e| Error::io("duplicate the descriptor", NAME, e))?;
        Self::from_bundle(&BundleFile::open_part(&own.into(), offset, length, NAME)?, Networks::default())
    }

    /// Loads some networks of an opened bundle. The others' tensors are not read, so not checked.
    ///
    /// ```no_run
    /// use visavis::{BundleFile, Engine, Networks, Sampler, SessionOptions};
    ///
    /// # fn main() -> visavis::Result<()> {
    /// // A headset that only ever makes a single step.
    /// let small = Networks { reference: false, encoder: false, modulation: false, ..Networks::default() };
    /// let engine = Engine::from_bundle(&BundleFile::open("models/visavis-base-i8.safetensors")?, small)?;
    /// let session = engine.session(SessionOptions { sampler: Sampler::Single, ..SessionOptions::default() })?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Engine::load`]; [`ErrorKind::Argument`] when neither the reference network nor a
    /// student is left.
    pub fn from_bundle(file: &BundleFile<'_>, networks: Networks) -> Result<Arc<Self>> {
        Self::from_file_with(file, Kernels::detect()?, networks)
    }

    /// Loads all of an opened bundle for the given kernels.
    ///
    /// # Errors
    /// As [`Engine::load`].
    #[doc(hidden)]
    pub fn from_file(file: &BundleFile<'_>, kernels: Kernels) -> Result<Arc<Self>> {
        Self::from_file_with(file, kernels, Networks::default())
    }

    /// As [`Engine::from_bundle`], for the given kernels.
    ///
    /// # Errors
    /// As [`Engine::from_bundle`].
    #[doc(hidden)]
    pub fn from_file_with(file: &BundleFile<'_>, kernels: Kernels, networks: Networks) -> Result<Arc<Self>> {
        let (config, tensors) = file.parse()?;
        let engine = Self::build(config, &tensors, kernels, networks).map_err(|e| e.with_path(file.path()))?;
        Ok(Arc::new(engine))
    }

    /// An engine of given tensors; [`Engine::from_bundle`] is the way for bundles.
    ///
    /// # Errors
    /// As [`Engine::from_bundle`].
    #[cfg(feature = "internals")]
    #[doc(hidden)]
    pub fn from_tensors(config: Config, t: &Tensors<'_>, kernels: Kernels, networks: Networks) -> Result<Arc<Self>> {
        Self::build(config, t, kernels, networks).map(Arc::new)
    }

    fn build(config: Config, t: &Tensors<'_>, kernels: Kernels, networks: Networks) -> Result<Self> {
        let some = networks.reference || networks.student && config.student.is_some();
        if !some {
            let message =
                "no network to make motion with: load the reference network, or the student of a bundle that has one";
            return Err(Error::new(ErrorKind::Argument, message));
        }
        let features = feature_count(config.rig.joints.len());
        let latent = config.vae.latent;
        let layout = ConditionLayout { audio_features: config.audio.features };
        let idle = Idle::read(t, features, latent)?;
        let net = |prefix: &str, wanted: bool, times: Vec<f32>| {
            if !wanted {
                t.skip(&format!("{prefix}."));
                return Ok(None);
            }
            let times = (!networks.modulation).then_some(times.as_slice());
            FlowNet::load(t, kernels, &config.flow, latent, layout, prefix, times).map(Some)
        };
        // Tensors of a student that the config does not have are not skipped: they are an error.
        let student = config.student.map(|s| net("student", networks.student, student_times(s.tau_history)));
        let student = student.transpose()?.flatten();
        let flow_times = reference_times(Sampler::Midpoint4, config.session.clean_history);
        let flow = net("flow", networks.reference, flow_times)?;
        let audio_source = AudioSource::load(t, &config.audio)?;
        let encoder = match idle {
            Idle::Latents(_) if !networks.encoder => {
                t.skip("vae.encoder.");
                None
            }
            _ => Some(Encoder::load(t, kernels, &config.vae, features)?),
        };
        let mut engine = Self {
            audio: audio_source.pack(kernels, &config.audio)?,
            encoder: None,
            decoder: Decoder::load(t, kernels, &config.vae, features)?,
            flow,
            student,
            pose: normaliser(t, "stats.pose", features)?,
            latent: normaliser(t, "stats.latent", latent)?,
            idle: Standardised::default(),
            #[cfg(feature = "tract")]
            audio_source,
            kernels,
            config,
        };
        t.finish()?;
        engine.idle = match (idle, &encoder) {
            (Idle::Latents(latents), _) => latents,
            (Idle::Frames(frames), Some(encoder)) => engine.encode(encoder, frames.view())?,
            (Idle::Frames(_), None) => Standardised::default(),
        };
        engine.encoder = encoder.filter(|_| networks.encoder);
        Ok(engine)
    }

    /// Latents `[n / 4, latent]` of `n` consecutive feature vectors.
    fn encode(&self, encoder: &Encoder, frames: Metric<&[f32]>) -> Result<Standardised> {
        let (features, latent) = (self.features(), self.latent.width());
        let blocks = frames.values().len() / (BLOCK_FRAMES * features);
        let mut exec = self.exec(1)?;
        let (mut state, mut work) = (encoder.state(KvDtype::F32), self.decoder.work(1));
        let (mut block, mut z) = (Standardised::zeros(BLOCK_FRAMES * features), Metric::zeros(latent));
        let mut latents = Standardised::zeros(blocks * latent);
        exec.begin();
        for i in 0..blocks {
            self.pose.standardise(frames.part(i..i + 1, BLOCK_FRAMES * features), block.view_mut());
            encoder.step(&mut exec, &mut work, &mut state, block.view(), z.view_mut());
            self.latent.standardise(z.view(), latents.part_mut(i..i + 1, latent));
        }
        exec.end();
        Ok(latents)
    }

    /// The networks that make latents.
    pub(crate) fn nets(&self) -> Nets<'_> {
        let student = self.student.as_ref().zip(self.config.student.map(|s| s.tau_history));
        Nets { reference: self.flow.as_ref(), student }
    }

    /// The model's name, as its bundle tells it.
    pub fn name(&self) -> &str {
        &self.config.name
    }

    /// The licence of the weights, with the acknowledgements that their data asks for.
    pub fn licence(&self) -> &str {
        &self.config.licence
    }

    /// The skeleton of all frames.
    pub fn rig(&self) -> &Rig {
        &self.config.rig
    }

    /// Whether the single-step student was loaded, which [`Sampler::Single`] needs.
    pub fn has_student(&self) -> bool {
        self.student.is_some()
    }

    /// The CPU level that the weights are packed for, as `VISAVIS_CPU` names it: `avx512`,
    /// `dotprod`, ...
    pub fn cpu_level(&self) -> &'static str {
        self.kernels.level().name()
    }

    /// The bundle's configuration.
    #[doc(hidden)]
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The kernels that its weights are packed for.
    #[doc(hidden)]
    pub fn kernels(&self) -> Kernels {
        self.kernels
    }

    /// Blocks of the idle clip, which are the first tokens of every session.
    #[doc(hidden)]
    pub fn idle_blocks(&self) -> usize {
        self.idle.values().len() / self.latent.width()
    }

    /// Bytes of all packed weights.
    pub fn weight_bytes(&self) -> usize {
        let net = |n: &FlowNet| n.pass_bytes() + n.condition_bytes() + n.modulation_bytes();
        let flows: usize = self.flow.iter().chain(&self.student).map(net).sum();
        flows + self.encoder.as_ref().map_or(0, Encoder::bytes) + self.decoder.bytes() + self.audio.bytes()
    }

    /// Bytes of packed weights that a block with `sampler` reads: the flow once per evaluation, the
    /// decoder once, the audio encoder once per voice. Re-anchoring and slots that catch up come on
    /// top.
    pub fn block_bytes(&self, sampler: Sampler) -> usize {
        let nets = self.nets();
        let (pass, condition) = nets.of(sampler).map_or((0, 0), |net| (net.pass_bytes(), net.condition_bytes()));
        sampler.evaluations() * pass + condition + self.decoder.bytes() + 2 * self.audio.bytes()
    }

    /// Width of a pose feature vector.
    pub(crate) fn features(&self) -> usize {
        self.pose.width()
    }

    /// Conditioning layout of the flow networks.
    pub(crate) fn layout(&self) -> ConditionLayout {
        ConditionLayout { audio_features: self.config.audio.features }
    }

    /// An executor with scratch for the widest operation of any of the networks.
    pub(crate) fn exec(&self, threads: usize) -> Result<Exec> {
        let c = &self.config;
        let audio = AudioEncoder::width(&c.audio);
        let flow =
            [c.flow.width * c.flow.mlp.max(6), c.flow.embed_user + 2 * c.flow.embed_voice + c.flow.embed_gaze + 4];
        let rest =
            [c.vae.width * c.vae.mlp.max(3), self.features(), 4 * c.audio.features, c.vae.latent, c.flow.tau_width];
        let width = flow.into_iter().chain(rest).fold(audio, usize::max);
        // Voices are what is shared out whole.
        Exec::new(self.kernels, threads, width)?.with_workers(audio)
    }
}

/// The idle clip, as bundles hold it: exported ones its frames, quantised ones the latents that the
/// encoder made of them.
enum Idle {
    /// Pose features in metres, `[4 blocks, features]`.
    Frames(Metric),
    /// Latents, `[blocks, latent]`.
    Latents(Standardised),
}

impl Idle {
    fn read(t: &Tensors<'_>, features: usize, latent: usize) -> Result<Self> {
        let invalid = |message| Err(Error::new(ErrorKind::BundleInvalid, message));
        if t.has(IDLE_LATENTS) {
            let most = MAX_IDLE_FRAMES / BLOCK_FRAMES;
            return match t.f32_rows(IDLE_LATENTS, latent)? {
                (blocks, _) if blocks > most => {
                    invalid(format!("tensor {IDLE_LATENTS} has {blocks} blocks, not up to {most}"))
                }
                (_, latents) => Ok(Self::Latents(Standardised::new(latents))),
            };
        }
        match t.f32_rows(IDLE_FRAMES, features)? {
            (frames, _) if frames % BLOCK_FRAMES != 0 || frames > MAX_IDLE_FRAMES => invalid(format!(
                "tensor {IDLE_FRAMES} has {frames} frames, not a multiple of {BLOCK_FRAMES} up to {MAX_IDLE_FRAMES}"
            )),
            (_, features) => Ok(Self::Frames(Metric::new(features))),
        }
    }
}

fn normaliser(t: &Tensors<'_>, name: &str, width: usize) -> Result<Normaliser> {
    Normaliser::new(name, t.f32(&format!("{name}_mean"), &[width])?, t.f32(&format!("{name}_std"), &[width])?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::SafeTensors;

    fn golden(name: &str) -> Vec<f32> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/tiny-golden.safetensors");
        let bytes = std::fs::read(path).unwrap();
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let (numbers, _) = file.tensor(name).unwrap().data().as_chunks::<4>();
        numbers.iter().map(|b| f32::from_le_bytes(*b)).collect()
    }

    /// The encoder alone: what `tests/parity.rs` sees of it only through the history.
    #[test]
    fn encoder_equals_pytorch() {
        let engine = Engine::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens/tiny.safetensors")).unwrap();
        let mu = Metric::new(golden("encoder.mu"));
        let mut expected = Standardised::zeros(mu.values().len());
        engine.latent.standardise(mu.view(), expected.view_mut());
        let frames = Metric::new(golden("encoder.frames"));
        let latents = engine.encode(engine.encoder().unwrap(), frames.view()).unwrap();
        let (latents, expected) = (latents.values(), expected.values());
        assert_eq!(latents.len(), expected.len());
        let error = latents.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(error < 1e-4, "{error}");
        let idle =
            engine.idle.values().iter().zip(golden("idle.latents")).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(idle < 1e-4, "{idle}");
    }
}
