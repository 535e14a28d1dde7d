//! The bundle's configuration: everything about sizes, rates and the rig that weights alone do not
//! say.
//!
//! Stored as JSON under the key `visavis` of the safetensors metadata; written by
//! `training/visavis_train/export.py`.

mod dram;
mod mospa;

pub use dram::{DramBundle, DramConfig, LstmConfig, TcnConfig};
pub use mospa::{MospaBundle, MospaConfig};

use crate::rig::Rig;
use crate::scheme::Scheme;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format version that this build reads and writes.
pub const FORMAT: u32 = 1;

/// Which generator a bundle is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The flow model; bundles that do not say are of this kind.
    #[default]
    Sarah,
    /// Dyadic residual attention, the featherweight tier.
    Dram,
    /// Reactions to whole clips of sound (MOSPA's model); no sessions.
    Mospa,
}

impl Kind {
    /// As bundles spell it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sarah => "sarah",
            Self::Dram => "dram",
            Self::Mospa => "mospa",
        }
    }

    fn is_sarah(&self) -> bool {
        *self == Self::Sarah
    }
}

/// Configuration of a bundle. Sections that its kind does not have are empty: sizes 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Format version, [`FORMAT`].
    pub format: u32,
    /// The generator.
    #[serde(default, skip_serializing_if = "Kind::is_sarah")]
    pub kind: Kind,
    /// Name of the model.
    pub name: String,
    /// One or two sentences: what it was trained on and for.
    pub description: String,
    /// Licence statement of the weights, with the acknowledgements that their data asks for.
    pub licence: String,
    /// Blocks by which the user's voice and position lag the block they steer (1: up to the end of
    /// the block before).
    pub user_delay_blocks: u32,
    /// Blocks by which the agent's own voice lags (0: known ahead, as from text-to-speech).
    pub agent_delay_blocks: u32,
    /// The skeleton.
    pub rig: Rig,
    /// Pose representation; none (radius 0) for other kinds than `sarah`.
    #[serde(skip_serializing_if = "PoseConfig::is_empty")]
    pub pose: PoseConfig,
    /// Audio encoder; none (no layers) for `mospa`.
    #[serde(skip_serializing_if = "AudioConfig::is_empty")]
    pub audio: AudioConfig,
    /// Variational autoencoder of motion; none (sizes 0) for other kinds than `sarah`.
    #[serde(skip_serializing_if = "VaeConfig::is_empty")]
    pub vae: VaeConfig,
    /// Flow transformer; none (sizes 0) for other kinds than `sarah`.
    #[serde(skip_serializing_if = "FlowConfig::is_empty")]
    pub flow: FlowConfig,
    /// Single-step student, when the bundle holds one.
    pub student: Option<StudentConfig>,
    /// Hearing of sounds in the room, of the kind `sarah`; none: sounds are not heard.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hearing: Option<HearingConfig>,
    /// What the networks of the kind `sarah` are told of how active the body is at rest; none:
    /// nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<RestConfig>,
    /// Predictors of the kind `dram`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dram: Option<DramConfig>,
    /// Denoiser of the kind `mospa`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mospa: Option<MospaConfig>,
    /// Defaults for sessions.
    pub session: SessionConfig,
    /// What the gaze channel does to this model's gaze, as `visavis calibrate` measured it; none:
    /// not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gaze: Option<GazeConfig>,
    /// How the weights were quantised; none for a bundle as it was exported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quantisation: Option<Quantisation>,
}

/// What the quantiser did to the weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quantisation {
    /// The scheme that was asked for.
    pub scheme: Scheme,
    /// Scheme of each weight matrix by its tensor's name; tensors that are not listed are floats.
    pub tensors: BTreeMap<String, Scheme>,
}

/// Pose representation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PoseConfig {
    /// Circumradius of the icosahedra, metres.
    pub radius: f32,
}

impl PoseConfig {
    fn is_empty(&self) -> bool {
        self.radius == 0.0
    }
}

/// Audio encoder: a stack of causal convolutions over 24 kHz mono, one feature vector per frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct AudioConfig {
    /// Convolutions, first to last; the product of their strides is 800.
    pub layers: Vec<ConvConfig>,
    /// Width of the feature vector.
    pub features: usize,
}

impl AudioConfig {
    fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }
}

/// One causal convolution: `kernel - stride` zeros (or carried samples) on the left, then GELU.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ConvConfig {
    /// Input channels.
    pub inputs: usize,
    /// Output channels.
    pub outputs: usize,
    /// Kernel length, at least `stride`.
    pub kernel: usize,
    /// Stride.
    pub stride: usize,
    /// Adds the input to the output; needs stride 1 and `inputs == outputs`.
    pub residual: bool,
}

/// Variational autoencoder of motion.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct VaeConfig {
    /// Transformer layers of the encoder and of the decoder, each.
    pub layers: usize,
    /// Width.
    pub width: usize,
    /// Attention heads.
    pub heads: usize,
    /// Width of the feed-forward layer over `width`.
    pub mlp: usize,
    /// Width of a latent, `D_z`.
    pub latent: usize,
    /// Sliding window, blocks, the current one included.
    pub window_blocks: usize,
}

/// Flow transformer.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FlowConfig {
    /// Transformer layers.
    pub layers: usize,
    /// Width.
    pub width: usize,
    /// Attention heads.
    pub heads: usize,
    /// Width of the feed-forward layer over `width`.
    pub mlp: usize,
    /// Width of the flow-time embedding.
    pub tau_width: usize,
    /// Sliding window, blocks, the current one included.
    pub window_blocks: usize,
    /// Width of the embedding of the noisy latent.
    pub embed_latent: usize,
    /// Width of the embedding of the user's position.
    pub embed_user: usize,
    /// Width of the embedding of each voice.
    pub embed_voice: usize,
    /// Width of the embedding of the gaze score.
    pub embed_gaze: usize,
    /// User positions are divided by this before they are embedded, metres.
    pub user_scale: f32,
}

impl VaeConfig {
    fn is_empty(&self) -> bool {
        self.layers == 0
    }
}

impl FlowConfig {
    fn is_empty(&self) -> bool {
        self.layers == 0
    }
}

/// Hearing of sounds in the room.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HearingConfig {
    /// Encoder of what both ears hear.
    pub audio: AudioConfig,
    /// Width of the embedding of the sound vector.
    pub embed: usize,
    /// What is made of what is heard.
    pub appraisal: AppraisalConfig,
    /// How many times as far guidance goes while a sound is reacted to: `weight - 1` is multiplied
    /// by it. 1 changes nothing.
    #[serde(default = "unscaled")]
    pub guidance: f32,
}

/// Which reaction a sound calls for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AppraisalConfig {
    /// LSTM cells.
    pub width: usize,
    /// Names of the reactions; [`AppraisalConfig::NONE`] is that to go on as if nothing sounded.
    pub reactions: Vec<String>,
}

impl AppraisalConfig {
    /// Name of the reaction that is none.
    pub const NONE: &str = "stay";
}

impl HearingConfig {
    /// What a frame of the sound vector has: features, and shares of the reactions behind them.
    pub fn told(&self) -> usize {
        self.audio.features + self.appraisal.reactions.len()
    }

    /// Length S of a block's sound vector: what 4 frames have, levels of 4 frames at 2 ears, the
    /// place of what stands out (5), and the sensitivity.
    pub fn width(&self) -> usize {
        4 * self.told() + 8 + 5 + 1
    }
}

/// Single-step student.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StudentConfig {
    /// Flow time at which the student sees its (clean) history.
    pub tau_history: f32,
    /// Guidance weight that was distilled in.
    pub guidance: f32,
    /// Gaze guidance weight that was distilled in.
    pub gaze_guidance: f32,
    /// Scale of the noise of blocks that it makes; absent: that of all blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f32>,
}

/// Defaults for sessions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SessionConfig {
    /// Guidance weight.
    pub guidance: f32,
    /// Gaze guidance weight.
    pub gaze_guidance: f32,
    /// Scale of the noise that blocks start from; 1 samples what was trained, less gives calmer
    /// motion.
    #[serde(default = "unscaled")]
    pub temperature: f32,
    /// Late evaluations see history nearly clean; absent: history is imputed at each evaluation's
    /// own flow time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clean_history: Option<CleanHistory>,
    /// Evaluations at this flow time and later are conditional alone, one branch instead of two or
    /// three; absent: all are guided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guided_until: Option<f32>,
    /// Time constant with which the difference at a border between blocks dies away, frames; 0
    /// leaves borders as decoded.
    #[serde(default = "bridge")]
    pub bridge: f32,
    /// Blocks between re-anchorings; 0 never.
    pub anchor_period: u32,
    /// Distance from the anchor at which the session re-anchors early, metres.
    pub anchor_radius: f32,
}

impl SessionConfig {
    /// Of a generator without noise, guidance or anything to encode anew.
    fn plain(bridge: f32) -> Self {
        Self {
            guidance: 1.0,
            gaze_guidance: 1.0,
            temperature: 1.0,
            clean_history: None,
            guided_until: None,
            bridge,
            anchor_period: 0,
            anchor_radius: 1.0,
        }
    }
}

/// What the gaze channel does to a model's gaze.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GazeConfig {
    /// The reference network with gaze guidance.
    pub guided: ResponseCurve,
    /// The reference network with the channel as one condition among others.
    pub unguided: ResponseCurve,
    /// The single-step student, when the bundle holds one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub student: Option<ResponseCurve>,
    /// Mean gaze scores of stretches of recorded conversations at evenly spaced quantiles from the
    /// least to the largest: what free gaze is drawn from.
    pub levels: Vec<f32>,
    /// Length of such a stretch, seconds.
    pub seconds: f32,
}

impl GazeConfig {
    /// The curves that there are, by name.
    pub fn curves(&self) -> impl Iterator<Item = (&'static str, &ResponseCurve)> {
        let student = self.student.iter().map(|curve| ("student", curve));
        [("guided", &self.guided), ("unguided", &self.unguided)].into_iter().chain(student)
    }
}

/// Values of the activity of a body at rest: the share of time in which its hands are not still, the
/// speed of the hands, that of the head; each about -1 to 1.
pub const ACTIVITY: usize = 3;

/// How active the body is at rest, and the networks' way in for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RestConfig {
    /// Hidden width of what embeds the activity.
    pub embed: usize,
    /// Activity of stretches of real people at rest: what a body at rest draws from.
    pub levels: Vec<[f32; ACTIVITY]>,
    /// Length of such a stretch, seconds.
    pub seconds: f32,
    /// What the reference network must be told to be as active, as `visavis calibrate` measured it;
    /// none: what is wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<RestResponse>,
    /// The same of the student.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub student: Option<RestResponse>,
}

impl RestConfig {
    /// The responses that there are, by the name of their network.
    pub fn responses(&self) -> impl Iterator<Item = (&'static str, &RestResponse)> {
        let both = [("reference", &self.reference), ("student", &self.student)];
        both.into_iter().filter_map(|(name, response)| Some((name, response.as_ref()?)))
    }
}

/// In whose company a body is at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Company {
    /// A user who is silent.
    Silent,
    /// Nobody that it sees.
    Nobody,
    /// A user who speaks.
    Speaking,
}

/// What a network must be told to be as active at rest as is wanted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RestResponse {
    /// Value by value, before a user who is silent.
    pub curves: [ResponseCurve; ACTIVITY],
    /// Added to what is wanted where nobody is seen: told the same, a body is more active there.
    pub alone: [f32; ACTIVITY],
    /// Added to what is wanted while the user speaks: what a listener has more of than people who
    /// wait, less what the network does of itself.
    pub listening: [f32; ACTIVITY],
    /// For how long it is told the same on average, seconds: bodies also move because they are told
    /// something new.
    pub seconds: f32,
}

impl RestResponse {
    /// What brings `wanted` about.
    pub fn told(&self, wanted: [f32; ACTIVITY], company: Company) -> [f32; ACTIVITY] {
        let more = match company {
            Company::Silent => [0.0; ACTIVITY],
            Company::Nobody => self.alone,
            Company::Speaking => self.listening,
        };
        std::array::from_fn(|i| self.curves[i].channel(wanted[i] + more[i]))
    }
}

/// Pairs of what a network does (a mean gaze score, an activity) and the channel's value that brings
/// it about, both ascending; linear between, constant beyond.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ResponseCurve(pub Vec<[f32; 2]>);

impl ResponseCurve {
    /// The channel's value for a wanted response.
    pub fn channel(&self, score: f32) -> f32 {
        let above = self.0.partition_point(|[s, _]| *s < score);
        match (above.checked_sub(1).map(|i| self.0[i]), self.0.get(above)) {
            (Some([s0, c0]), Some([s1, c1])) => c0 + (c1 - c0) * (score - s0) / (s1 - s0),
            (None, Some([_, c])) => *c,
            (Some([_, c]), None) => c,
            (None, None) => score,
        }
    }
}

/// Flow time at which history enters an evaluation at flow time `t`: `t` itself below `from`,
/// `max(t, tau)` from there.
///
/// Early evaluations decide what happens and listen to the conditions; late ones, over a clean
/// past, join it smoothly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CleanHistory {
    /// Least flow time of history in late evaluations, 0 to 1.
    pub tau: f32,
    /// Flow time of the first late evaluation, 0 to 1.
    pub from: f32,
}

impl CleanHistory {
    /// Flow time of history for an evaluation at `t`.
    pub fn time(&self, t: f32) -> f32 {
        if t < self.from { t } else { t.max(self.tau) }
    }
}

fn bridge() -> f32 {
    0.8
}

fn unscaled() -> f32 {
    1.0
}
