//! Given conditioning and noise through a session, every stage out: so that anyone can check the
//! maths against an implementation of their own.
//!
//! Input, a safetensors file (float tensors are f32 or f16; tensors of other names are ignored, so
//! a file may hold expected results beside its inputs, as those of
//! `training/visavis_train/goldens.py` do):
//!
//! | tensor | shape | what |
//! |---|---|---|
//! | `agent_voice`, `user_voice` | `[N]` | 24 kHz mono, float at full scale 1 or i16; silence after the end; absent if left out |
//! | `user_path` | `[T, 3]` | world position of the user's head at each frame, metres; absent if left out |
//! | `gaze` | `[1]` | gaze target, -1 to 1; none if left out |
//! | `eps`, `eps_idle` | `[K, Dz]`, `[M, Dz]` | noise of the K blocks and of the idle clip's M tokens, both or neither; else from the seed |
//!
//! The K blocks to run are those of `eps`, else as many as the longest of the other inputs covers.
//! Output, stacked over blocks (T = 4 K frames, B branches: unconditional, conditional, and with
//! gaze when there is a target):
//!
//! | tensor | shape | what |
//! |---|---|---|
//! | `agent_features` | `[T - 4 d, D_a]` | audio features of frame `i` in row `i`; d blocks of delay stay unheard at the end |
//! | `user_features` | likewise | of the user's voice |
//! | `conditioning.user` | `[K, 8]` | (x, z) of four frames in the agent's frame, metres; zeros where unknown |
//! | `conditioning.flags` | `[K, 4]` | presence of user position, agent's voice, user's voice, gaze: 0 or 1 |
//! | `x1.{k}` | `[NFE, B, Dz]` | the flow network's outputs in block k |
//! | `latents` | `[K, Dz]` | finished latents, standardised |
//! | `decoded` | `[T, F]` | features of each frame, standardised |
//! | `roots` | `[T, 3]` | x, z (metres), yaw (radians), world |
//! | `positions`, `rotations` | `[T, J, 3]`, `[T, J, 4]` | joints in the world: metres, quaternions (x, y, z, w) |

mod input;

pub use input::TraceInput;

use crate::export::write_atomically;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;
use visavis::internals::session::{Diagnostics, GazeControl, Probe};
use visavis::{BLOCK_FRAMES, Engine, Error, ErrorKind, FPS, Result, SAMPLE_RATE, SessionOptions};

/// A dense array, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Shape.
    pub shape: Vec<usize>,
    /// Values.
    pub values: Vec<f32>,
}

/// Every stage of a run, by the names in the table of this module.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Stages by name.
    pub stages: BTreeMap<String, Array>,
}

/// Runs `input` through a session made with `options`, whose gaze is replaced by the input's, and
/// returns every stage.
///
/// For comparisons with an implementation of the networks alone, ask for
/// [`visavis::internals::kernels::KvDtype::F32`] and
/// [`visavis::internals::session::Anchoring::Never`], and turn [`Diagnostics::bridge`] and
/// [`SessionOptions::stance`] off.
///
/// # Errors
/// [`ErrorKind::Argument`] for options that the bundle cannot do, and one of another kind than `sarah`, [`ErrorKind::Audio`] for voices
/// that are not finite.
pub fn trace(engine: &Arc<Engine>, input: &TraceInput, options: SessionOptions) -> Result<Trace> {
    engine.needs_sarah()?;
    let diagnostics = Diagnostics { gaze_control: GazeControl::Channel, ..options.diagnostics };
    let mut session = engine.session(SessionOptions { gaze: input.gaze, diagnostics, ..options })?;
    if let Some(noise) = &input.noise {
        session.reset_with_noise(noise.clone())?;
    }
    let mut recorder = Recorder::default();
    let mut voices = [&input.agent_voice, &input.user_voice].map(|v| v.as_deref().unwrap_or_default().chunks(3200));
    let mut path =
        input.user_path.iter().flatten().enumerate().map(|(i, p)| (*p, i as f64 / f64::from(FPS))).peekable();
    for _ in 0..input.blocks {
        let now = session.next_due();
        if let Some(samples) = voices[0].next() {
            session.push_agent_audio(samples, SAMPLE_RATE)?;
        }
        if let Some(samples) = voices[1].next() {
            session.push_user_audio(samples, SAMPLE_RATE)?;
        }
        while let Some((position, time)) = path.next_if(|(_, time)| *time <= now) {
            session.push_user_head(position, time)?;
        }
        recorder.begin_block(input.gaze.is_some());
        session.poll_with(now, Some(&mut recorder))?;
    }
    Ok(recorder.finish(engine, input.blocks))
}

/// Collects what the session's probe tells.
#[derive(Default)]
struct Recorder {
    stages: BTreeMap<&'static str, Vec<f32>>,
    /// Of each block, its evaluations one after the other; the length of one.
    x1: Vec<(Vec<f32>, usize)>,
    flags: Vec<[f32; 4]>,
    user: Vec<[f32; 2 * BLOCK_FRAMES]>,
}

impl Recorder {
    fn begin_block(&mut self, gaze: bool) {
        self.x1.push((Vec::new(), 1));
        self.flags.push([0.0, 0.0, 0.0, f32::from(u8::from(gaze))]);
        self.user.push([0.0; 2 * BLOCK_FRAMES]);
    }

    fn finish(self, engine: &Engine, blocks: usize) -> Trace {
        let config = engine.config();
        let (latent, joints, frames) = (config.vae.latent, config.rig.len(), blocks * BLOCK_FRAMES);
        let mut stages = BTreeMap::new();
        let mut put = |name: &str, shape: &[usize], values: Vec<f32>| {
            stages.insert(name.to_owned(), Array { shape: shape.to_vec(), values });
        };
        put("conditioning.user", &[blocks, 2 * BLOCK_FRAMES], self.user.concat());
        put("conditioning.flags", &[blocks, 4], self.flags.concat());
        for (k, (x1, evaluation)) in self.x1.into_iter().enumerate() {
            let shape = [x1.len() / evaluation, evaluation / latent, latent];
            put(&format!("x1.{k}"), &shape, x1);
        }
        for (name, values) in self.stages {
            let rows = |width: usize| vec![values.len() / width, width];
            let shape = match name {
                "agent_features" | "user_features" => rows(config.audio.features),
                "latents" => rows(latent),
                "roots" => rows(3),
                "positions" => vec![frames, joints, 3],
                "rotations" => vec![frames, joints, 4],
                _ => rows(values.len() / frames),
            };
            put(name, &shape, values);
        }
        Trace { stages }
    }
}

impl Probe for Recorder {
    fn stage(&mut self, block: u64, name: &'static str, values: &[f32]) {
        let block = block as usize;
        match name {
            "x1" => {
                let (all, evaluation) = &mut self.x1[block];
                all.extend_from_slice(values);
                *evaluation = values.len();
                return;
            }
            "conditioning.user" => {
                self.user[block].copy_from_slice(values);
                self.flags[block][0] = 1.0;
                return;
            }
            "agent_features" => self.flags[block][1] = 1.0,
            "user_features" => self.flags[block][2] = 1.0,
            _ => {}
        }
        self.stages.entry(name).or_default().extend_from_slice(values);
    }
}

impl Trace {
    /// Writes all stages as one safetensors file of f32 tensors, whole or not at all.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] naming `path`.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let path = path.as_ref();
        let failed = |e| Error::new(ErrorKind::Argument, format!("the stages cannot be stored: {e}")).with_path(path);
        let bytes: Vec<_> = self.stages.iter().map(|(name, array)| (name, array, le_bytes(&array.values))).collect();
        let views = (bytes.iter())
            .map(|(name, array, bytes)| Ok((name.as_str(), TensorView::new(Dtype::F32, array.shape.clone(), bytes)?)))
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(failed)?;
        let metadata = HashMap::from([("made_by".to_owned(), format!("visavis {} trace", env!("CARGO_PKG_VERSION")))]);
        let file = safetensors::serialize(views, Some(metadata)).map_err(failed)?;
        write_atomically(path, |w| w.write_all(&file))
    }
}

fn le_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}
