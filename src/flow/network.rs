//! Weights of the flow transformer, its embeddings and its modulation tables.

use super::{Condition, ConditionLayout};
use crate::bundle::Tensors;
use crate::config::FlowConfig;
use crate::error::Result;
use crate::kernels::{Epilogue, Exec, Kernels, Matrix, RowTable, WeightData, Weights};
use crate::nn::{Layer, LayerNorms, Rope};

/// Weights of a flow network, reference or student.
#[derive(Debug)]
pub struct FlowNet {
    config: FlowConfig,
    latent: usize,
    layout: ConditionLayout,
    /// `W_in[:, latent part] W_latent`: the latent's embedding folded into the input projection, `[d, latent]`.
    input_latent: Matrix,
    /// The rest of the input projection, `[d, embeddings + 4 flags]`; its bias holds the latent embedding's too.
    input_rest: Matrix,
    /// `input_rest` of a token with everything absent.
    unconditional: Vec<f32>,
    embed_user: (Matrix, Matrix),
    embed_agent_voice: Matrix,
    embed_user_voice: Matrix,
    embed_gaze: Matrix,
    pub(super) layers: Vec<Layer>,
    pub(super) out: Matrix,
    pub(super) rope: Rope,
    tau: TauWeights,
}

/// What turns a flow time into modulation vectors; used at load and session start, never in a block.
#[derive(Debug)]
struct TauWeights {
    first: Matrix,
    second: Matrix,
    layers: Vec<Matrix>,
    last: Matrix,
}

/// AdaLN-Zero shift, scale and gate of every layer for a list of flow times.
///
/// They depend on the flow time alone, so `6 d^2` weights a layer stay out of the hot path. One row of the table a flow
/// time: six vectors a layer (shift, 1 + scale, gate of the attention, then of the feed-forward), then the final shift
/// and 1 + scale.
#[derive(Debug)]
pub struct Modulation {
    table: Vec<f32>,
    width: usize,
    layers: usize,
}

impl FlowNet {
    /// Reads `{prefix}.*` (`flow` or `student`).
    ///
    /// # Errors
    /// As [`Tensors::f32`].
    pub fn load(
        t: &Tensors<'_>,
        kernels: Kernels,
        c: &FlowConfig,
        latent: usize,
        layout: ConditionLayout,
        prefix: &str,
    ) -> Result<Self> {
        let (d, mlp) = (c.width, c.width * c.mlp);
        let name = |part: &str| format!("{prefix}.{part}");
        let linear = |part: &str, outputs, inputs| t.linear(kernels, &name(part), outputs, &[inputs]);
        let layer = |i: usize| -> Result<Layer> {
            let linear = |part: &str, outputs, inputs| linear(&format!("layers.{i}.{part}"), outputs, inputs);
            Ok(Layer {
                qkv: linear("qkv", 3 * d, d)?,
                proj: linear("proj", d, d)?,
                fc1: linear("fc1", mlp, d)?,
                fc2: linear("fc2", d, mlp)?,
            })
        };
        let tau = TauWeights {
            first: linear("tau.0", c.tau_width, c.tau_width)?,
            second: linear("tau.2", c.tau_width, c.tau_width)?,
            layers: (0..c.layers)
                .map(|i| linear(&format!("layers.{i}.mod"), 6 * d, c.tau_width))
                .collect::<Result<_>>()?,
            last: linear("final.mod", 2 * d, c.tau_width)?,
        };

        let rest = c.embed_user + 2 * c.embed_voice + c.embed_gaze + 4;
        let stored = t.weights(&name("input"), d, &[c.embed_latent + rest])?;
        let input = stored.to_f32();
        let input_bias = t.f32(&name("input.bias"), &[d])?;
        let embed = t.weights(&name("embed_latent"), c.embed_latent, &[latent])?.to_f32();
        let embed_bias = t.f32(&name("embed_latent.bias"), &[c.embed_latent])?;
        let (folded, bias) = fold(&input, &input_bias, &embed, &embed_bias, latent);
        let folded = Weights { rows: d, cols: latent, data: WeightData::F32(&folded) };
        Ok(Self {
            config: *c,
            latent,
            layout,
            input_latent: kernels.pack(folded, None),
            input_rest: stored.pack_columns(kernels, c.embed_latent.., Some(&bias)),
            unconditional: bias,
            embed_user: (linear("embed_user.0", c.embed_user, 8)?, linear("embed_user.2", c.embed_user, c.embed_user)?),
            embed_agent_voice: linear("embed_agent", c.embed_voice, 4 * layout.audio_features)?,
            embed_user_voice: linear("embed_voice", c.embed_voice, 4 * layout.audio_features)?,
            embed_gaze: linear("embed_gaze", c.embed_gaze, 4)?,
            layers: (0..c.layers).map(layer).collect::<Result<_>>()?,
            out: linear("final.out", latent, d)?,
            rope: Rope::new(d / c.heads),
            tau,
        })
    }

    /// Bytes of the packed matrices that one evaluation reads.
    pub fn pass_bytes(&self) -> usize {
        self.layers.iter().map(Layer::bytes).sum::<usize>() + self.input_latent.bytes() + self.out.bytes()
    }

    /// Bytes of the packed matrices that a block reads once, to embed its conditioning.
    pub fn condition_bytes(&self) -> usize {
        let embeds = [&self.embed_user.0, &self.embed_user.1, &self.embed_agent_voice, &self.embed_user_voice];
        embeds.into_iter().chain([&self.embed_gaze, &self.input_rest]).map(Matrix::bytes).sum()
    }

    /// Bytes of the packed matrices that turn flow times into modulation, read when a session starts.
    pub fn modulation_bytes(&self) -> usize {
        let once = [&self.tau.first, &self.tau.second, &self.tau.last];
        once.into_iter().chain(&self.tau.layers).map(Matrix::bytes).sum()
    }

    /// Sizes.
    pub fn config(&self) -> &FlowConfig {
        &self.config
    }

    /// Channels of a latent.
    pub fn latent(&self) -> usize {
        self.latent
    }

    /// Width of the embedded conditioning that [`FlowNet::project`] needs as scratch.
    pub(super) fn rest_width(&self) -> usize {
        self.input_rest.in_features()
    }

    /// The input of a token with everything absent, without the latent's part: `[d]`.
    pub(super) fn unconditional(&self) -> &[f32] {
        &self.unconditional
    }

    /// Input of the latents: `y += W z` for `rows` rows of `[latent]`.
    pub(super) fn embed_latent(&self, exec: &mut Exec, z: &[f32], rows: usize, y: &mut [f32]) {
        exec.linear(&self.input_latent, z, rows, y, Epilogue::Store);
    }

    /// Input of a token's conditioning, `out` `[2, d]`: without a guided gaze target, and with it (the same if there is none, or
    /// if it is not guided towards).
    /// `embedded` is scratch of `2 x rest_width`.
    pub(super) fn project(&self, exec: &mut Exec, condition: &Condition, embedded: &mut [f32], out: &mut [f32]) {
        let (c, rest) = (&self.config, self.rest_width());
        let layout = condition.layout();
        debug_assert_eq!(layout, self.layout);
        let [user, agent, voice, gaze] = condition.present;
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
        exec.linear(&self.input_rest, embedded, 2, out, Epilogue::Store);
    }

    /// Modulation tables of the given flow times.
    pub fn modulation(&self, exec: &mut Exec, taus: &[f32]) -> Modulation {
        let (d, layers, width) = (self.config.width, self.config.layers, self.config.tau_width);
        let stride = layers * 6 * d + 2 * d;
        let mut table = vec![0.0; taus.len() * stride];
        let (mut a, mut b) = (vec![0.0; width], vec![0.0; width]);
        for (tau, row) in taus.iter().zip(table.chunks_exact_mut(stride)) {
            sinusoids(*tau, &mut a);
            exec.linear(&self.tau.first, &a, 1, &mut b, Epilogue::Store);
            exec.silu(&mut b);
            exec.linear(&self.tau.second, &b, 1, &mut a, Epilogue::Store);
            exec.silu(&mut a);
            let (per_layer, last) = row.split_at_mut(layers * 6 * d);
            for (m, six) in self.tau.layers.iter().zip(per_layer.chunks_exact_mut(6 * d)) {
                exec.linear(m, &a, 1, six, Epilogue::Store);
                six[d..2 * d].iter_mut().for_each(|s| *s += 1.0);
                six[4 * d..5 * d].iter_mut().for_each(|s| *s += 1.0);
            }
            exec.linear(&self.tau.last, &a, 1, last, Epilogue::Store);
            last[d..].iter_mut().for_each(|s| *s += 1.0);
        }
        Modulation { table, width: d, layers }
    }
}

impl Modulation {
    fn stride(&self) -> usize {
        self.layers * 6 * self.width + 2 * self.width
    }

    fn rows<'a>(&'a self, vector: usize, index: &'a [u32]) -> RowTable<'a> {
        RowTable { table: &self.table, stride: self.stride(), offset: vector * self.width, index }
    }

    /// Norms and gates of layer `layer`; `index` holds the flow time's number of each row.
    pub(super) fn layer<'a>(&'a self, layer: usize, index: &'a [u32]) -> LayerNorms<'a> {
        let v = |i| self.rows(layer * 6 + i, index);
        LayerNorms { norm1: (v(0), v(1)), gate1: Some(v(2)), norm2: (v(3), v(4)), gate2: Some(v(5)) }
    }

    /// Final shift and scale.
    pub(super) fn last<'a>(&'a self, index: &'a [u32]) -> (RowTable<'a>, RowTable<'a>) {
        (self.rows(self.layers * 6, index), self.rows(self.layers * 6 + 1, index))
    }
}

/// Embedding of a flow time: cosines then sines of `1000 tau` at frequencies `10000^(-i / half)`.
fn sinusoids(tau: f32, out: &mut [f32]) {
    let half = out.len() / 2;
    for i in 0..half {
        let angle = 1000.0 * f64::from(tau) * libm::pow(10_000.0, -(i as f64) / half as f64);
        out[i] = libm::cos(angle) as f32;
        out[half + i] = libm::sin(angle) as f32;
    }
}

/// `(W_in[:, ..e] E, b_in + W_in[:, ..e] e_b)` in f64.
fn fold(input: &[f32], bias: &[f32], embed: &[f32], embed_bias: &[f32], latent: usize) -> (Vec<f32>, Vec<f32>) {
    let (d, e) = (bias.len(), embed_bias.len());
    let columns = input.len() / d;
    let mut folded = vec![0f32; d * latent];
    let mut out_bias = vec![0f32; d];
    let mut sums = vec![0f64; latent];
    for (r, row) in input.chunks_exact(columns).enumerate() {
        sums.fill(0.0);
        let mut b = f64::from(bias[r]);
        for ((w, embed_row), eb) in row[..e].iter().zip(embed.chunks_exact(latent)).zip(embed_bias) {
            b += f64::from(*w) * f64::from(*eb);
            sums.iter_mut().zip(embed_row).for_each(|(s, v)| *s += f64::from(*w) * f64::from(*v));
        }
        out_bias[r] = b as f32;
        folded[r * latent..][..latent].iter_mut().zip(&sums).for_each(|(f, s)| *f = *s as f32);
    }
    (folded, out_bias)
}
