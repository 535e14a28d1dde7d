//! Weights of the flow transformer and its embeddings.

use super::modulation::{Modulation, Modulator};
use super::{Condition, ConditionLayout};
use crate::bundle::Tensors;
use crate::config::{Config, FlowConfig};
use crate::error::Result;
use crate::kernels::{Epilogue, Exec, Kernels, Matrix, WeightData, Weights};
use crate::nn::{Layer, Pass, Rope, Sizes};
use std::sync::Arc;

/// Weights of a flow network, reference or student.
#[derive(Debug)]
pub struct FlowNet {
    config: FlowConfig,
    latent: usize,
    layout: ConditionLayout,
    /// `W_in[:, latent part] W_latent`: the latent's embedding folded into the input projection,
    /// `[d, latent]`.
    input_latent: Matrix,
    /// The rest of the input projection, `[d, embeddings + 4 flags]`; its bias holds the latent
    /// embedding's too.
    input_rest: Matrix,
    /// `input_rest` of a token with everything absent.
    unconditional: Vec<f32>,
    embed_user: (Matrix, Matrix),
    embed_agent_voice: Matrix,
    embed_user_voice: Matrix,
    embed_gaze: Matrix,
    sound: Option<Sound>,
    /// The way in of the activity at rest.
    activity: Option<(Matrix, Matrix)>,
    layers: Vec<Layer>,
    out: Matrix,
    rope: Rope,
    modulator: Modulator,
}

/// The way in of the sound vector.
#[derive(Debug)]
struct Sound {
    embed: (Matrix, Matrix),
    /// Of the embedding and a one, `[d, E + 1]`.
    input: Matrix,
}

impl FlowNet {
    /// Reads `{prefix}.*` (`flow` or `student`). With `times` the modulation weights are not kept,
    /// but a table of these flow times.
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn load(
        t: &Tensors<'_>,
        kernels: Kernels,
        config: &Config,
        layout: ConditionLayout,
        prefix: &str,
        times: Option<&[f32]>,
    ) -> Result<Self> {
        let (c, latent) = (&config.flow, config.vae.latent);
        let (d, mlp) = (c.width, c.width * c.mlp);
        let name = |part: &str| format!("{prefix}.{part}");
        let linear = |part: &str, outputs, inputs| t.linear(kernels, &name(part), outputs, &[inputs]);
        let sound = |e: usize| -> Result<Sound> {
            let input = name("input_sound");
            Ok(Sound {
                embed: (linear("embed_sound.0", e, layout.sound)?, linear("embed_sound.2", e, e)?),
                input: t.weights(&input, d, &[e + 1])?.pack(kernels, &input, None),
            })
        };
        let activity = |e: usize| -> Result<_> {
            Ok((linear("embed_activity.0", e, layout.activity)?, linear("embed_activity.2", d, e)?))
        };
        let layer = |i: usize| -> Result<Layer> {
            let linear = |part: &str, outputs, inputs| linear(&format!("layers.{i}.{part}"), outputs, inputs);
            Ok(Layer {
                qkv: linear("qkv", 3 * d, d)?,
                proj: linear("proj", d, d)?,
                fc1: linear("fc1", mlp, d)?,
                fc2: linear("fc2", d, mlp)?,
            })
        };
        // First: the weights may be gone again before the others come.
        let modulator = Modulator::load(t, kernels, c, prefix, times)?;
        let rest = c.embed_user + 2 * c.embed_voice + c.embed_gaze + 4;
        let stored = t.weights(&name("input"), d, &[c.embed_latent + rest])?;
        let input = stored.to_f32();
        let input_bias = t.f32(&name("input.bias"), &[d])?;
        let embed = t.weights(&name("embed_latent"), c.embed_latent, &[latent])?.to_f32();
        let embed_bias = t.f32(&name("embed_latent.bias"), &[c.embed_latent])?;
        // The latent's way in is two linear layers: W_in[:, ..e] E, and b_in + W_in[:, ..e] e_b.
        let folded = kernels.fold(&input, stored.cols, &embed, c.embed_latent, latent);
        let folded = Weights { rows: d, cols: latent, data: WeightData::F32(&folded) };
        let add = |b: f64, (w, eb): (&f32, &f32)| b + f64::from(*w) * f64::from(*eb);
        let bias: Vec<_> = (input.chunks_exact(stored.cols).zip(&input_bias))
            .map(|(row, b)| row.iter().zip(&embed_bias).fold(f64::from(*b), add) as f32)
            .collect();
        Ok(Self {
            config: *c,
            latent,
            layout,
            input_latent: kernels.pack(folded, None),
            input_rest: stored.pack_columns(&input, kernels, c.embed_latent.., Some(&bias)),
            unconditional: bias,
            embed_user: (linear("embed_user.0", c.embed_user, 8)?, linear("embed_user.2", c.embed_user, c.embed_user)?),
            embed_agent_voice: linear("embed_agent", c.embed_voice, 4 * layout.audio_features)?,
            embed_user_voice: linear("embed_voice", c.embed_voice, 4 * layout.audio_features)?,
            embed_gaze: linear("embed_gaze", c.embed_gaze, 4)?,
            sound: config.hearing.as_ref().map(|h| sound(h.embed)).transpose()?,
            activity: config.rest.as_ref().map(|rest| activity(rest.embed)).transpose()?,
            layers: (0..c.layers).map(layer).collect::<Result<_>>()?,
            out: linear("final.out", latent, d)?,
            rope: Rope::new(d / c.heads),
            modulator,
        })
    }

    /// A pass for up to `rows` rows.
    pub(super) fn pass(&self, rows: usize) -> Pass {
        let FlowConfig { width, heads, mlp, .. } = self.config;
        Pass::new(Sizes { width, heads, hidden: width * mlp }, rows, &self.rope)
    }

    pub(super) fn layers(&self) -> &[Layer] {
        &self.layers
    }

    pub(super) fn rope(&self) -> &Rope {
        &self.rope
    }

    /// The projection of normed rows to latents.
    pub(super) fn out(&self) -> &Matrix {
        &self.out
    }

    /// Bytes of the packed matrices that one evaluation reads.
    pub fn pass_bytes(&self) -> usize {
        self.layers.iter().map(Layer::bytes).sum::<usize>() + self.input_latent.bytes() + self.out.bytes()
    }

    /// Bytes of the packed matrices that a block reads once, to embed its conditioning.
    pub fn condition_bytes(&self) -> usize {
        let embeds = [&self.embed_user.0, &self.embed_user.1, &self.embed_agent_voice, &self.embed_user_voice];
        let sound = self.sound.iter().flat_map(|s| [&s.embed.0, &s.embed.1, &s.input]);
        let activity = self.activity.iter().flat_map(|(hidden, out)| [hidden, out]);
        let both = [&self.embed_gaze, &self.input_rest];
        embeds.into_iter().chain(both).chain(sound).chain(activity).map(Matrix::bytes).sum()
    }

    /// Bytes of what flow times are turned into modulation with, read when a session starts: packed
    /// matrices, or a table.
    pub fn modulation_bytes(&self) -> usize {
        self.modulator.bytes()
    }

    /// Sizes.
    pub fn config(&self) -> &FlowConfig {
        &self.config
    }

    /// Channels of a latent.
    pub fn latent(&self) -> usize {
        self.latent
    }

    /// Width of the embedded conditioning.
    fn rest_width(&self) -> usize {
        self.input_rest.in_features()
    }

    /// Floats that [`FlowNet::project`] needs as scratch.
    pub(super) fn scratch(&self) -> usize {
        // An embedding's hidden layer, itself and a one, and what it adds to the input.
        let sound = self.sound.as_ref().map_or(0, |s| 2 * s.input.in_features() + self.config.width);
        let activity = self.activity.as_ref().map_or(0, |(hidden, _)| hidden.out_features() + self.config.width);
        sound.max(2 * self.rest_width()).max(activity)
    }

    /// Input of the latents: `y += W z` for `rows` rows of `[latent]`.
    pub(super) fn embed_latent(&self, exec: &mut Exec, z: &[f32], rows: usize, y: &mut [f32]) {
        exec.linear(&self.input_latent, z, rows, y, Epilogue::Store);
    }

    /// Input of a token's conditioning, `out` `[INPUTS, d]`: with everything absent that guidance is
    /// towards, without a guided gaze target, and with it (the same if there is none, or if it is
    /// not guided towards). `scratch` has [`FlowNet::scratch`] floats.
    pub(super) fn project(&self, exec: &mut Exec, condition: &Condition, scratch: &mut [f32], out: &mut [f32]) {
        let (c, rest) = (&self.config, self.rest_width());
        let layout = condition.layout();
        debug_assert_eq!(layout, self.layout);
        let [user, agent, voice, gaze] = condition.present;
        let embedded = &mut scratch[..2 * rest];
        let (row, with) = embedded.split_at_mut(rest);
        row.fill(0.0);
        let (e_user, tail) = row.split_at_mut(c.embed_user);
        let (e_agent, tail) = tail.split_at_mut(c.embed_voice);
        let (e_voice, tail) = tail.split_at_mut(c.embed_voice);
        let (e_gaze, flags) = tail.split_at_mut(c.embed_gaze);
        if user {
            let mut scaled = [0f32; 8];
            for (s, v) in scaled.iter_mut().zip(&condition.values[layout.user()]) {
                *s = v / c.user_scale;
            }
            let hidden = &mut with[..c.embed_user];
            exec.linear(&self.embed_user.0, &scaled, 1, hidden, Epilogue::Gelu);
            exec.linear(&self.embed_user.1, hidden, 1, e_user, Epilogue::Store);
        }
        if agent {
            exec.linear(&self.embed_agent_voice, &condition.values[layout.agent_voice()], 1, e_agent, Epilogue::Store);
        }
        if voice {
            exec.linear(&self.embed_user_voice, &condition.values[layout.user_voice()], 1, e_voice, Epilogue::Store);
        }
        let without = gaze && !condition.guides_gaze();
        for (flag, present) in flags.iter_mut().zip([user, agent, voice, without]) {
            *flag = f32::from(u8::from(present));
        }
        if gaze {
            exec.linear(&self.embed_gaze, &condition.values[layout.gaze()], 1, e_gaze, Epilogue::Store);
        }
        with[..rest].copy_from_slice(row);
        if !without {
            row[rest - 4 - c.embed_gaze..rest - 4].fill(0.0);
        }
        with[rest - 1] = f32::from(u8::from(gaze));
        let (unconditional, conditional) = out.split_at_mut(c.width);
        unconditional.copy_from_slice(&self.unconditional);
        exec.linear(&self.input_rest, embedded, 2, conditional, Epilogue::Store);
        if let Some(sound) = self.sound.as_ref().filter(|_| condition.hears) {
            sound.add(exec, &condition.values[layout.sound()], scratch, conditional);
        }
        if let Some((embed, input)) = self.activity.as_ref().filter(|_| condition.rests) {
            let (hidden, rest) = scratch.split_at_mut(embed.out_features());
            exec.linear(embed, &condition.values[layout.activity()], 1, hidden, Epilogue::Gelu);
            let added = &mut rest[..c.width];
            exec.linear(input, hidden, 1, added, Epilogue::Store);
            add_to_rows(added, out);
        }
    }

    /// Modulation of the given flow times.
    ///
    /// # Errors
    /// [`crate::error::ErrorKind::Argument`] when the weights for it were not kept, and these are
    /// not the times of the table in their place.
    pub fn modulation(&self, exec: &mut Exec, times: &[f32]) -> Result<Arc<Modulation>> {
        self.modulator.modulation(exec, &self.config, times)
    }
}

impl Sound {
    /// Adds the vector's embedding to each row of `out`.
    fn add(&self, exec: &mut Exec, vector: &[f32], scratch: &mut [f32], out: &mut [f32]) {
        let (embed, width) = (self.embed.1.out_features(), self.input.out_features());
        let (hidden, rest) = scratch.split_at_mut(embed);
        let (e, rest) = rest.split_at_mut(embed + 1);
        exec.linear(&self.embed.0, vector, 1, hidden, Epilogue::Gelu);
        exec.linear(&self.embed.1, hidden, 1, &mut e[..embed], Epilogue::Store);
        e[embed] = 1.0;
        let added = &mut rest[..width];
        exec.linear(&self.input, e, 1, added, Epilogue::Store);
        add_to_rows(added, out);
    }
}

/// Adds `added` to each row of `rows`.
fn add_to_rows(added: &[f32], rows: &mut [f32]) {
    for row in rows.chunks_exact_mut(added.len()) {
        row.iter_mut().zip(added).for_each(|(x, a)| *x += a);
    }
}
