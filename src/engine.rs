//! The engine: a loaded bundle, immutable, shared by any number of sessions.

mod model;
#[cfg(feature = "internals")]
mod round_trip;

pub(crate) use model::{Model, Sarah};

use crate::audio::{AudioEncoder, AudioWeights};
use crate::bundle::{AudioSource, BundleFile, LoadMode, Tensors};
use crate::config::{Config, Kind};
use crate::dram::Dram;
use crate::error::{Error, ErrorKind, Result};
use crate::flow::ConditionLayout;
use crate::frame::{BLOCK_FRAMES, Sampler};
use crate::hearing::{AppraisalWeights, HearingWeights};
use crate::kernels::{Exec, Kernels};
use crate::rig::Rig;
use std::path::Path;
use std::sync::Arc;

/// Which networks of a bundle an engine holds.
///
/// What no session will use need not take memory, nor time to load. Bundles of the kind `dram` are
/// always loaded whole.
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
/// let engine = Engine::load("models/visavis-room-i8.safetensors")?;
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
    /// Of the encoder of sounds in the room, where the bundle has hearing.
    pub(crate) hearing: Option<HearingWeights>,
    #[cfg(feature = "tract")]
    pub(crate) audio_source: AudioSource,
    pub(crate) model: Model,
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
    /// let engine = Engine::from_bundle(&BundleFile::open("models/visavis-room-i8.safetensors")?, small)?;
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
        if config.kind == Kind::Mospa {
            let message = "a bundle of the kind `mospa` reacts to whole clips of sound and has no sessions; run it with `visavis react`";
            return Err(Error::new(ErrorKind::Argument, message));
        }
        let audio_source = AudioSource::load(t, &config.audio, "audio")?;
        let mut exec = exec(&config, kernels, 1)?;
        let hearing = config.hearing.as_ref().map(|h| HearingWeights::load(t, kernels, &mut exec, h));
        let model = match &config.dram {
            None => Model::Sarah(Box::new(Sarah::load(t, kernels, &mut exec, &config, networks)?)),
            Some(dram) => {
                let dram = Dram::load(t, kernels, &mut exec, dram, &config.rig, config.audio.features)?;
                Model::Dram(Box::new(dram))
            }
        };
        let engine = Self {
            audio: audio_source.pack(kernels, &config.audio)?,
            hearing: hearing.transpose()?,
            model,
            #[cfg(feature = "tract")]
            audio_source,
            kernels,
            config,
        };
        t.finish()?;
        Ok(engine)
    }

    /// The networks of the kind `sarah`, for what other kinds do not have.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a bundle of another kind.
    pub(crate) fn sarah(&self) -> Result<&Sarah> {
        match &self.model {
            Model::Sarah(sarah) => Ok(sarah),
            Model::Dram(_) => Err(Error::new(
                ErrorKind::Argument,
                "a bundle of the kind `dram` has no latents, samplers or calibration; this needs one of the kind `sarah`",
            )),
        }
    }

    /// Fails where there is no flow model.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a bundle of another kind than `sarah`.
    #[doc(hidden)]
    pub fn needs_sarah(&self) -> Result<()> {
        self.sarah().map(drop)
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

    /// Whether the bundle hears sounds in the room
    /// ([`Session::push_sound`](crate::Session::push_sound)).
    pub fn has_hearing(&self) -> bool {
        self.hearing.is_some()
    }

    /// Whether the single-step student was loaded, which [`Sampler::Single`] needs.
    pub fn has_student(&self) -> bool {
        self.sarah().is_ok_and(|sarah| sarah.student.is_some())
    }

    /// The generator that the bundle is for, as it spells it: `sarah`, the flow model, or `dram`, the
    /// featherweight tier.
    pub fn kind(&self) -> &'static str {
        self.config.kind.name()
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

    /// Blocks of the idle clip, which are the first tokens of every session; 0 without tokens.
    #[doc(hidden)]
    pub fn idle_blocks(&self) -> usize {
        self.sarah().map_or(0, Sarah::idle_blocks)
    }

    /// Bytes of all packed weights.
    pub fn weight_bytes(&self) -> usize {
        self.audio.bytes()
            + self.hearing.as_ref().map_or(0, HearingWeights::bytes)
            + match &self.model {
                Model::Sarah(sarah) => sarah.bytes(),
                Model::Dram(dram) => dram.bytes(),
            }
    }

    /// Bytes of packed weights that a block with `sampler` reads: the flow once per evaluation, the
    /// decoder once, the audio encoder once per voice, that of sounds in the room once; of the kind
    /// `dram`, the predictors once per frame. Re-anchoring and slots that catch up come on top.
    pub fn block_bytes(&self, sampler: Sampler) -> usize {
        2 * self.audio.bytes()
            + self.hearing.as_ref().map_or(0, HearingWeights::bytes)
            + match &self.model {
                Model::Sarah(sarah) => sarah.block_bytes(sampler),
                Model::Dram(dram) => BLOCK_FRAMES * dram.bytes(),
            }
    }

    /// Conditioning layout of the flow networks.
    pub(crate) fn layout(&self) -> ConditionLayout {
        ConditionLayout::of(&self.config)
    }

    /// An executor with scratch for the widest operation of any of the networks.
    pub(crate) fn exec(&self, threads: usize) -> Result<Exec> {
        exec(&self.config, self.kernels, threads)
    }
}

/// An executor for all networks of `config`.
fn exec(config: &Config, kernels: Kernels, threads: usize) -> Result<Exec> {
    let hearing = config.hearing.as_ref();
    let hearing = hearing.map_or(0, |h| AudioEncoder::width(&h.audio).max(AppraisalWeights::width(h)));
    let audio = AudioEncoder::width(&config.audio).max(hearing);
    let (features, joints) = (config.audio.features, config.rig.len());
    let width = match &config.dram {
        None => model::widest(config),
        Some(dram) => Dram::widest_of(dram, joints, features),
    };
    // Voices, and the room, are what is shared out whole.
    Exec::new(kernels, threads, width.max(audio))?.with_workers(audio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normaliser::{Metric, Standardised};
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
        engine.sarah().unwrap().latent.standardise(mu.view(), expected.view_mut());
        let frames = Metric::new(golden("encoder.frames"));
        let sarah = engine.sarah().unwrap();
        let mut exec = engine.exec(1).unwrap();
        let latents = sarah.encode(&mut exec, engine.encoder().unwrap(), frames.view());
        let (latents, expected) = (latents.values(), expected.values());
        assert_eq!(latents.len(), expected.len());
        let error = latents.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(error < 1e-4, "{error}");
        let idle =
            sarah.idle.values().iter().zip(golden("idle.latents")).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(idle < 1e-4, "{idle}");
    }
}
