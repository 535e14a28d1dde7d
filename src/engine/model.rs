//! The networks of a bundle, by its kind.

use super::Networks;
use crate::bundle::{IDLE_FRAMES, IDLE_LATENTS, Tensors};
use crate::config::Config;
use crate::dram::Dram;
use crate::error::{Error, ErrorKind, Result};
use crate::flow::{ConditionLayout, FlowNet, Nets, flow_times, reference_slots, student_slots};
use crate::frame::{BLOCK_FRAMES, Sampler, feature_count};
use crate::kernels::{Exec, Kernels, KvDtype};
use crate::normaliser::{Metric, Normaliser, Standardised};
use crate::vae::{Decoder, Encoder};

/// Most frames of an idle clip: every session starts by going through them.
const MAX_IDLE_FRAMES: usize = 3600;

/// What makes motion.
#[derive(Debug)]
pub(crate) enum Model {
    /// The flow model.
    Sarah(Box<Sarah>),
    /// The featherweight tier.
    Dram(Box<Dram>),
}

/// The networks of the kind `sarah`.
#[derive(Debug)]
pub(crate) struct Sarah {
    pub(crate) encoder: Option<Encoder>,
    pub(crate) decoder: Decoder,
    pub(crate) flow: Option<FlowNet>,
    pub(crate) student: Option<FlowNet>,
    /// Flow time at which the student sees its history.
    tau_history: f32,
    pub(crate) pose: Normaliser,
    pub(crate) latent: Normaliser,
    /// Latents of the idle clip, `[blocks, latent]`.
    pub(crate) idle: Standardised,
}

impl Sarah {
    pub(super) fn load(
        t: &Tensors<'_>,
        kernels: Kernels,
        exec: &mut Exec,
        config: &Config,
        networks: Networks,
    ) -> Result<Self> {
        let some = networks.reference || networks.student && config.student.is_some();
        if !some {
            let message =
                "no network to make motion with: load the reference network, or the student of a bundle that has one";
            return Err(Error::new(ErrorKind::Argument, message));
        }
        let features = feature_count(config.rig.joints.len());
        let latent = config.vae.latent;
        let layout = ConditionLayout::of(config);
        let idle = Idle::read(t, features, latent)?;
        let net = |prefix: &str, wanted: bool, times: Vec<f32>| {
            if !wanted {
                t.skip(&format!("{prefix}."));
                return Ok(None);
            }
            let times = (!networks.modulation).then_some(times.as_slice());
            FlowNet::load(t, kernels, config, layout, prefix, times).map(Some)
        };
        // Tensors of a student that the config does not have are not skipped: they are an error.
        let student =
            config.student.map(|s| net("student", networks.student, flow_times(&student_slots(s.tau_history))));
        let student = student.transpose()?.flatten();
        let slots = reference_slots(Sampler::Midpoint4, config.session.clean_history, None);
        let flow = net("flow", networks.reference, flow_times(&slots))?;
        let encoder = match idle {
            Idle::Latents(_) if !networks.encoder => {
                t.skip("vae.encoder.");
                None
            }
            _ => Some(Encoder::load(t, kernels, &config.vae, features)?),
        };
        let mut sarah = Self {
            encoder: None,
            decoder: Decoder::load(t, kernels, &config.vae, features)?,
            flow,
            student,
            tau_history: config.student.map_or(1.0, |s| s.tau_history),
            pose: normaliser(t, "stats.pose", features)?,
            latent: normaliser(t, "stats.latent", latent)?,
            idle: Standardised::default(),
        };
        sarah.idle = match (idle, &encoder) {
            (Idle::Latents(latents), _) => latents,
            (Idle::Frames(frames), Some(encoder)) => sarah.encode(exec, encoder, frames.view()),
            (Idle::Frames(_), None) => Standardised::default(),
        };
        sarah.encoder = encoder.filter(|_| networks.encoder);
        Ok(sarah)
    }

    /// Latents `[n / 4, latent]` of `n` consecutive feature vectors.
    pub(super) fn encode(&self, exec: &mut Exec, encoder: &Encoder, frames: Metric<&[f32]>) -> Standardised {
        let (features, latent) = (self.features(), self.latent.width());
        let blocks = frames.values().len() / (BLOCK_FRAMES * features);
        let (mut state, mut work) = (encoder.state(KvDtype::F32), self.decoder.work(1));
        let (mut block, mut z) = (Standardised::zeros(BLOCK_FRAMES * features), Metric::zeros(latent));
        let mut latents = Standardised::zeros(blocks * latent);
        exec.begin();
        for i in 0..blocks {
            self.pose.standardise(frames.part(i..i + 1, BLOCK_FRAMES * features), block.view_mut());
            encoder.step(exec, &mut work, &mut state, block.view(), z.view_mut());
            self.latent.standardise(z.view(), latents.part_mut(i..i + 1, latent));
        }
        exec.end();
        latents
    }

    /// The networks that make latents.
    pub(crate) fn nets(&self) -> Nets<'_> {
        Nets { reference: self.flow.as_ref(), student: self.student.as_ref().map(|net| (net, self.tau_history)) }
    }

    /// Width of a pose feature vector.
    pub(crate) fn features(&self) -> usize {
        self.pose.width()
    }

    pub(super) fn idle_blocks(&self) -> usize {
        self.idle.values().len() / self.latent.width()
    }

    /// Bytes of the packed weights.
    pub(super) fn bytes(&self) -> usize {
        let net = |n: &FlowNet| n.pass_bytes() + n.condition_bytes() + n.modulation_bytes();
        let flows: usize = self.flow.iter().chain(&self.student).map(net).sum();
        flows + self.encoder.as_ref().map_or(0, Encoder::bytes) + self.decoder.bytes()
    }

    /// Those that a block with `sampler` reads.
    pub(super) fn block_bytes(&self, sampler: Sampler) -> usize {
        let net = self.nets().of(sampler);
        let (pass, condition) = net.map_or((0, 0), |net| (net.pass_bytes(), net.condition_bytes()));
        sampler.evaluations() * pass + condition + self.decoder.bytes()
    }
}

/// Inputs of the widest layer of the kind `sarah`.
pub(super) fn widest(c: &Config) -> usize {
    let flow = [c.flow.width * c.flow.mlp.max(6), c.flow.embed_user + 2 * c.flow.embed_voice + c.flow.embed_gaze + 4];
    let features = feature_count(c.rig.joints.len());
    let sound = c.hearing.as_ref().map_or(0, |h| h.width().max(h.embed + 1));
    let rest = [c.vae.width * c.vae.mlp.max(3), features, 4 * c.audio.features, c.vae.latent, c.flow.tau_width];
    flow.into_iter().chain(rest).fold(sound, usize::max)
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
