//! Reading and checking what a trace is run on.

use glam::Vec3;
use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use std::path::Path;
use visavis::internals::frame::BLOCK_SAMPLES;
use visavis::{BLOCK_FRAMES, Engine, Error, ErrorKind, Result};

/// Most blocks that are traced: ten minutes, whose stages already take hundreds of megabytes.
const MAX_BLOCKS: usize = 4500;
/// Longest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Conditioning and noise of a run; see the table of [`crate::trace`].
#[derive(Debug, Clone, PartialEq)]
pub struct TraceInput {
    /// The agent's voice, 24 kHz mono.
    pub agent_voice: Option<Vec<f32>>,
    /// The user's voice, 24 kHz mono.
    pub user_voice: Option<Vec<f32>>,
    /// World position of the user's head at each frame, metres.
    pub user_path: Option<Vec<Vec3>>,
    /// Gaze target, -1 to 1.
    pub gaze: Option<f32>,
    /// Noise `[M + K, Dz]`, that of the idle clip's tokens first.
    pub noise: Option<Vec<f32>>,
    /// Blocks to run, K.
    pub blocks: usize,
}

impl TraceInput {
    /// Reads the inputs for `engine` from a safetensors file.
    ///
    /// # Errors
    /// [`ErrorKind::Io`] when it cannot be read; [`ErrorKind::Argument`], naming file and tensor,
    /// when it is not safetensors, a tensor has another shape or type than the table says or is not
    /// finite, or no block would be run.
    pub fn read(path: impl AsRef<Path>, engine: &Engine) -> Result<Self> {
        let path = path.as_ref();
        let bytes = visavis::internals::bounded::read(path, MAX_BYTES)
            .map_err(|e| Error::io("read the trace's input", path, e))?;
        Self::parse(&bytes, engine).map_err(|e| e.with_path(path))
    }

    /// As [`TraceInput::read`], from the bytes of a file.
    ///
    /// # Errors
    /// As [`TraceInput::read`], without a file name.
    pub fn parse(bytes: &[u8], engine: &Engine) -> Result<Self> {
        let file = SafeTensors::deserialize(bytes)
            .map_err(|e| bad(format!("not a safetensors file, or damaged ({e}); write it again")))?;
        let latent = engine.config().vae.latent;
        let agent_voice = values(&file, "agent_voice", &[None])?;
        let user_voice = values(&file, "user_voice", &[None])?;
        let path = values(&file, "user_path", &[None, Some(3)])?;
        let gaze = values(&file, "gaze", &[Some(1)])?.map(|v| v[0]);
        let eps = values(&file, "eps", &[None, Some(latent)])?;
        let idle = values(&file, "eps_idle", &[Some(engine.idle_blocks()), Some(latent)])?;
        let voice_blocks = |v: &Option<Vec<f32>>| v.as_ref().map_or(0, |v| v.len().div_ceil(BLOCK_SAMPLES));
        let path_blocks = path.as_ref().map_or(0, |p| (p.len() / 3).div_ceil(BLOCK_FRAMES));
        let blocks = match &eps {
            Some(eps) => eps.len() / latent,
            None => path_blocks.max(voice_blocks(&agent_voice)).max(voice_blocks(&user_voice)),
        };
        if blocks == 0 || blocks > MAX_BLOCKS {
            return Err(bad(format!(
                "{blocks} blocks to run, not 1 to {MAX_BLOCKS}; give eps, user_path, agent_voice or user_voice"
            )));
        }
        let noise = match (idle, eps) {
            (Some(idle), Some(eps)) => Some([idle, eps].concat()),
            (None, None) => None,
            (Some(_), None) => return Err(bad("eps_idle without eps; give the noise of the blocks too, or none")),
            (None, Some(_)) => return Err(bad("eps without eps_idle; give the noise of the idle clip's tokens too")),
        };
        let user_path = path.map(|p| p.chunks_exact(3).map(Vec3::from_slice).collect());
        Ok(Self { agent_voice, user_voice, user_path, gaze, noise, blocks })
    }
}

/// The values of a tensor of the given shape (`None`: any length), or `None` where there is no such
/// tensor.
fn values(file: &SafeTensors<'_>, name: &str, shape: &[Option<usize>]) -> Result<Option<Vec<f32>>> {
    let Ok(view) = file.tensor(name) else { return Ok(None) };
    let fits = view.shape().len() == shape.len()
        && view.shape().iter().zip(shape).all(|(found, expected)| expected.is_none_or(|e| e == *found));
    if !fits {
        let expected: Vec<_> = shape.iter().map(|n| n.map_or_else(|| "any".to_owned(), |n| n.to_string())).collect();
        return Err(bad(format!("tensor {name} has shape {:?}, expected [{}]", view.shape(), expected.join(", "))));
    }
    let values = numbers(name, &view)?;
    match values.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(bad(format!("tensor {name} holds {} at element {i}", values[i]))),
        None => Ok(Some(values)),
    }
}

fn numbers(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>> {
    let data = view.data();
    match view.dtype() {
        Dtype::F32 => Ok(data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()),
        Dtype::F16 => Ok(data.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect()),
        // Full scale is that of `Wav`; only voices come as integers.
        Dtype::I16 if name.ends_with("_voice") => {
            Ok(data.chunks_exact(2).map(|b| f32::from(i16::from_le_bytes([b[0], b[1]])) / 32768.0).collect())
        }
        other => Err(bad(format!("tensor {name} is {other:?}; store it as F32"))),
    }
}

fn bad(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::Argument, message)
}
