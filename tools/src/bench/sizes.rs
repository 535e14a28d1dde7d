//! Networks of known sizes with seeded weights.

use std::sync::Arc;
use visavis::internals::bundle::Tensors;
use visavis::internals::config::{
    AppraisalConfig, AudioConfig, Config, ConvConfig, FORMAT, FlowConfig, HearingConfig, Kind, PoseConfig,
    SessionConfig, StudentConfig, VaeConfig,
};
use visavis::internals::kernels::{Kernels, Scheme};
use visavis::{Engine, Error, ErrorKind, Joint, Networks, Result, Rig};

/// A size of all networks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// SARAH's: flow 4 x 1024, autoencoder 9 x 256, 127 joints.
    Paper,
    /// Between the two: flow 6 x 512, autoencoder 4 x 256, 22 joints; audio features 96 wide.
    Mid,
    /// The shipped one's: flow 4 x 256, autoencoder 4 x 192, 22 joints.
    Base,
}

impl std::str::FromStr for Size {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        match s {
            "paper" => Ok(Self::Paper),
            "mid" => Ok(Self::Mid),
            "base" => Ok(Self::Base),
            _ => Err(Error::new(ErrorKind::Argument, format!("unknown size {s:?}: paper, mid or base"))),
        }
    }
}

impl Size {
    /// An engine of this size whose weights are drawn from a seed and stored as `scheme`; its
    /// motion means nothing. There is a student.
    ///
    /// # Errors
    /// None for these sizes; those of [`Engine::from_file`] if they were not sound.
    pub fn engine(self, scheme: Scheme, kernels: Kernels) -> Result<Arc<Engine>> {
        self.engine_with(scheme, kernels, Networks::default())
    }

    /// As [`Size::engine`], some networks only.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] without a network that makes motion.
    pub fn engine_with(self, scheme: Scheme, kernels: Kernels, networks: Networks) -> Result<Arc<Engine>> {
        Engine::from_tensors(self.config(), &Tensors::seeded(scheme), kernels, networks)
    }

    /// As [`Size::engine`], with hearing as in `HEARING`.
    ///
    /// # Errors
    /// As [`Size::engine`].
    pub fn engine_with_hearing(self, scheme: Scheme, kernels: Kernels, networks: Networks) -> Result<Arc<Engine>> {
        let shapes = [(10, 5), (10, 5), (8, 4), (8, 4), (4, 2), (3, 1)];
        let appraisal = AppraisalConfig { width: 48, reactions: (0..7).map(|i| i.to_string()).collect() };
        let hearing = HearingConfig { audio: encoder(&shapes, &HEARING, 24), embed: 64, appraisal, guidance: 1.0 };
        let config = Config { hearing: Some(hearing), ..self.config() };
        Engine::from_tensors(config, &Tensors::seeded(scheme), kernels, networks)
    }

    /// The bytes of a bundle with the weights of [`Size::engine`]: what loading takes can be
    /// measured on it.
    ///
    /// # Errors
    /// As [`Size::engine`].
    pub fn bundle(self, scheme: Scheme) -> Result<Vec<u8>> {
        let (config, tensors) = (self.config(), Tensors::seeded_and_kept(scheme));
        Engine::from_tensors(config.clone(), &tensors, Kernels::detect()?, Networks::default())?;
        tensors.bundle(&config)
    }

    fn config(self) -> Config {
        let rig = Rig::humanoid();
        let (name, rig, vae, flow, audio) = match self {
            Self::Paper => {
                let vae = VaeConfig { layers: 9, width: 256, heads: 4, mlp: 4, latent: 256, window_blocks: 16 };
                ("paper size, seeded", with_joints(rig, 127), vae, flow(1024, 100), audio(BASE_CHANNELS, 64))
            }
            Self::Mid => {
                let vae = VaeConfig { layers: 4, width: 256, heads: 4, mlp: 4, latent: 64, window_blocks: 16 };
                let flow = FlowConfig { layers: 6, heads: 8, tau_width: 128, embed_user: 64, ..flow(512, 48) };
                ("mid size, seeded", rig, vae, flow, audio([32, 64, 128, 192, 320, 320, 320], 96))
            }
            Self::Base => {
                let vae = VaeConfig { layers: 4, width: 192, heads: 4, mlp: 4, latent: 64, window_blocks: 16 };
                ("base size, seeded", rig, vae, flow(256, 48), audio(BASE_CHANNELS, 64))
            }
        };
        Config {
            format: FORMAT,
            kind: Kind::Sarah,
            name: name.into(),
            description: "Seeded weights for measuring speed; not a model".into(),
            licence: "none: the weights are random numbers".into(),
            user_delay_blocks: 1,
            agent_delay_blocks: 0,
            rig,
            pose: PoseConfig { radius: 0.1 },
            audio,
            vae,
            flow,
            dram: None,
            mospa: None,
            hearing: None,
            rest: None,
            student: Some(StudentConfig { tau_history: 0.9, guidance: 2.0, gaze_guidance: 1.5, temperature: None }),
            session: SessionConfig {
                guidance: 1.3,
                gaze_guidance: 1.5,
                temperature: 0.75,
                clean_history: None,
                guided_until: None,
                bridge: 0.8,
                // A round takes about a window of blocks; between two of them there are blocks
                // without.
                anchor_period: 4 * flow.window_blocks as u32,
                // The motion of seeded weights goes anywhere: where to says nothing.
                anchor_radius: 1e6,
            },
            gaze: None,
            quantisation: None,
        }
    }
}

fn flow(width: usize, window_blocks: usize) -> FlowConfig {
    FlowConfig {
        layers: 4,
        width,
        heads: 4,
        mlp: 4,
        tau_width: width / 2,
        window_blocks,
        embed_latent: width / 2,
        embed_user: width / 4,
        embed_voice: 3 * width / 8,
        embed_gaze: width / 16,
        user_scale: 2.0,
    }
}

/// Channels of the shipped model's encoder, 0.75 M parameters.
const BASE_CHANNELS: [usize; 7] = [24, 48, 96, 160, 256, 256, 256];

/// Channels of the encoder of sounds in the room; 24 features, embedded in 64.
const HEARING: [usize; 6] = [8, 16, 24, 32, 48, 48];

/// The voices' encoder with these channels after each convolution.
fn audio(channels: [usize; 7], features: usize) -> AudioConfig {
    encoder(&[(10, 5), (10, 5), (8, 4), (8, 4), (4, 2), (3, 1), (3, 1)], &channels, features)
}

/// An encoder of convolutions with these kernels and strides, and channels after each.
fn encoder(shapes: &[(usize, usize)], channels: &[usize], features: usize) -> AudioConfig {
    let mut inputs = 1;
    let layer = |(&(kernel, stride), &outputs): (&(usize, usize), &usize)| {
        let layer = ConvConfig { inputs, outputs, kernel, stride, residual: stride == 1 };
        inputs = outputs;
        layer
    };
    AudioConfig { layers: shapes.iter().zip(channels).map(layer).collect(), features }
}

/// The rig with further joints at the hands until there are `count`.
fn with_joints(mut rig: Rig, count: usize) -> Rig {
    let hands = ["leftHand", "rightHand"].map(|name| rig.index(name));
    for j in rig.len()..count {
        let offset = [0.0, -0.01, 0.01 * (j % 9) as f32];
        rig.joints.push(Joint { name: format!("extra{j}"), parent: hands[j % 2].or(Some(0)), offset });
    }
    rig
}
