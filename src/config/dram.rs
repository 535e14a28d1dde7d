//! Configuration of bundles of the kind `dram`.

use super::{AudioConfig, Config, FlowConfig, Kind, PoseConfig, Quantisation, SessionConfig, VaeConfig};
use crate::rig::Rig;
use serde::{Deserialize, Serialize};

/// The predictors: on the agent's own voice and motion (*monadic*), and on what the user does and
/// the monadic forecast (*dyadic*).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "backbone", rename_all = "lowercase", deny_unknown_fields)]
pub enum DramConfig {
    /// Dilated causal convolutions.
    Tcn {
        /// Monadic predictor.
        monadic: TcnConfig,
        /// Dyadic predictor.
        dyadic: TcnConfig,
    },
    /// Long short-term memory.
    Lstm {
        /// Monadic predictor.
        monadic: LstmConfig,
        /// Dyadic predictor.
        dyadic: LstmConfig,
    },
}

/// Residual layers over convolutions of kernel 2.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TcnConfig {
    /// Width.
    pub width: usize,
    /// Frames between the two taps of each layer's convolution, first to last.
    pub dilations: Vec<usize>,
}

/// Layers of LSTM cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LstmConfig {
    /// Width.
    pub width: usize,
    /// Layers.
    pub layers: usize,
}

/// A bundle's configuration as it is stored.
#[derive(Debug, Deserialize)]
pub struct DramBundle {
    format: u32,
    kind: Kind,
    name: String,
    description: String,
    licence: String,
    user_delay_blocks: u32,
    agent_delay_blocks: u32,
    rig: Rig,
    audio: AudioConfig,
    dram: DramConfig,
    session: Session,
    #[serde(default)]
    quantisation: Option<Quantisation>,
}

#[derive(Debug, Deserialize)]
struct Session {
    #[serde(default = "super::bridge")]
    bridge: f32,
}

impl From<DramBundle> for Config {
    fn from(bundle: DramBundle) -> Self {
        let DramBundle { format, kind, name, description, licence, user_delay_blocks, agent_delay_blocks, .. } = bundle;
        let DramBundle { rig, audio, dram, session, quantisation, .. } = bundle;
        let session = SessionConfig::plain(session.bridge);
        Self {
            format,
            kind,
            name,
            description,
            licence,
            user_delay_blocks,
            agent_delay_blocks,
            rig,
            pose: PoseConfig::default(),
            audio,
            vae: VaeConfig::default(),
            flow: FlowConfig::default(),
            student: None,
            hearing: None,
            rest: None,
            dram: Some(dram),
            mospa: None,
            session,
            gaze: None,
            quantisation,
        }
    }
}
