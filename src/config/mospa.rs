//! Configuration of bundles of the kind `mospa`.

use super::{AudioConfig, Config, FlowConfig, Kind, PoseConfig, Quantisation, SessionConfig, VaeConfig};
use crate::rig::Rig;
use serde::{Deserialize, Serialize};

/// The denoiser of whole clips.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MospaConfig {
    /// Frames of a clip.
    pub frames: usize,
    /// Frames of a token.
    pub patch: usize,
    /// Width.
    pub width: usize,
    /// Attention heads.
    pub heads: usize,
    /// Transformer layers.
    pub layers: usize,
    /// Width of the feed-forward layer over `width`.
    pub mlp: usize,
    /// Steps of the diffusion that it was trained on.
    pub diffusion_steps: usize,
    /// Steps that sampling takes where nobody says otherwise.
    pub steps: usize,
}

/// A bundle's configuration as it is stored.
#[derive(Debug, Deserialize)]
pub struct MospaBundle {
    format: u32,
    kind: Kind,
    name: String,
    description: String,
    licence: String,
    rig: Rig,
    mospa: MospaConfig,
    #[serde(default)]
    quantisation: Option<Quantisation>,
}

impl From<MospaBundle> for Config {
    fn from(bundle: MospaBundle) -> Self {
        let MospaBundle { format, kind, name, description, licence, rig, mospa, quantisation } = bundle;
        // No session goes by it.
        let session = SessionConfig::plain(0.0);
        Self {
            format,
            kind,
            name,
            description,
            licence,
            user_delay_blocks: 0,
            agent_delay_blocks: 0,
            rig,
            pose: PoseConfig::default(),
            audio: AudioConfig::default(),
            vae: VaeConfig::default(),
            flow: FlowConfig::default(),
            student: None,
            hearing: None,
            rest: None,
            dram: None,
            mospa: Some(mospa),
            session,
            gaze: None,
            quantisation,
        }
    }
}
