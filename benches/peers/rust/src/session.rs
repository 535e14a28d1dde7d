//! The streaming session around a network with explicit caches, as peers/stream.py is: rings,
//! phases, masks, the midpoint rule.

use crate::Result;
use crate::worker::Blocks;
use safetensors::SafeTensors;
use serde_json::Value;
use std::time::Instant;

const MASKED: f32 = -1e9;
/// Tokens of a block of the decoder.
pub const TOKENS: usize = 5;

/// Sizes of a transformer stack.
#[derive(Debug, Clone, Copy)]
pub struct Stack {
    pub layers: usize,
    pub width: usize,
    pub heads: usize,
    /// Earlier tokens that attention sees.
    pub past: usize,
}

impl Stack {
    pub fn head_dim(&self) -> usize {
        self.width / self.heads
    }
}

/// What `prepared.safetensors` holds.
pub struct Prepared {
    pub flow: Stack,
    pub decoder: Stack,
    pub latent: usize,
    pub features: usize,
    idle: usize,
    blocks: usize,
    evaluations: usize,
    guidance: f32,
    cond: Vec<f32>,
    pub modulation: Vec<Vec<f32>>,
    eps: Vec<f32>,
    idle_latents: Vec<f32>,
    mean: Vec<f32>,
    std: Vec<f32>,
}

impl Prepared {
    pub fn read(folder: &str) -> Result<Self> {
        let bytes = std::fs::read(format!("{folder}/prepared.safetensors"))?;
        let (_, metadata) = SafeTensors::read_metadata(&bytes)?;
        let sizes = metadata.metadata().as_ref().and_then(|m| m.get("sizes")).ok_or("sizes are missing")?;
        let sizes: Value = serde_json::from_str(sizes)?;
        let file = SafeTensors::deserialize(&bytes)?;
        let n = |v: &Value| v.as_u64().map(|n| n as usize).ok_or("a size is missing");
        let stack = |v: &Value, tokens: usize| -> Result<Stack> {
            let past = tokens * (n(&v["window_blocks"])? - 1);
            Ok(Stack { layers: n(&v["layers"])?, width: n(&v["width"])?, heads: n(&v["heads"])?, past })
        };
        let floats = |name: &str| -> Result<Vec<f32>> {
            Ok(file.tensor(name)?.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
        };
        let evaluations = 2 * n(&sizes["steps"])?;
        let modulation = floats("mod")?;
        Ok(Self {
            flow: stack(&sizes["flow"], 1)?,
            decoder: stack(&sizes["decoder"], TOKENS)?,
            latent: n(&sizes["latent"])?,
            features: n(&sizes["features"])?,
            idle: n(&sizes["idle"])?,
            blocks: n(&sizes["blocks"])?,
            evaluations,
            guidance: sizes["guidance"].as_f64().ok_or("no guidance")? as f32,
            cond: floats("cond")?,
            modulation: modulation.chunks_exact(modulation.len() / evaluations).map(<[f32]>::to_vec).collect(),
            eps: floats("eps")?,
            idle_latents: floats("idle")?,
            mean: floats("latent_mean")?,
            std: floats("latent_std")?,
        })
    }
}

/// Inputs of one pass that change from pass to pass, beside latents, caches and modulation.
pub struct Context {
    /// `[rows, head_dim / 2]`.
    pub cos: Vec<f32>,
    pub sin: Vec<f32>,
    /// `[rows, past + rows]`.
    pub bias: Vec<f32>,
}

/// The two networks of a peer, which keep the rings: `flow` one ring per slot, `decoder` one.
pub trait Networks {
    /// One evaluation at `slot`: `z` `[2, latent]`, `cond` `[2, 2, width]` (branch, row). Leaves x1
    /// `[2, latent]` in `x1` and writes the finished token's keys and values to place `at` of the
    /// slot's rings.
    fn flow(
        &mut self,
        slot: usize,
        z: &[f32],
        cond: &[f32],
        context: &Context,
        at: usize,
        x1: &mut [f32],
    ) -> Result<()>;
    /// One block: `z` `[latent]`, five new tokens to places `at ..` of the ring; frames `[4,
    /// features]`.
    fn decoder(&mut self, z: &[f32], context: &Context, at: usize, frames: &mut [f32]) -> Result<()>;
}

/// A session; see peers/stream.py for the same in fewer words.
pub struct Session<N> {
    p: Prepared,
    nets: N,
    token: usize,
    number: usize,
    done: Option<(Vec<f32>, usize)>,
    context: Context,
    decoder_context: Context,
    frames: Vec<f32>,
}

impl<N: Networks> Session<N> {
    pub fn new(p: Prepared, nets: N) -> Result<Self> {
        let context = |stack: &Stack, rows: usize| Context {
            cos: vec![0.0; rows * stack.head_dim() / 2],
            sin: vec![0.0; rows * stack.head_dim() / 2],
            bias: vec![MASKED; rows * (stack.past + rows)],
        };
        let (context, decoder_context) = (context(&p.flow, 2), context(&p.decoder, TOKENS));
        let frames = vec![0.0; 4 * p.features];
        let mut session = Self { p, nets, token: 0, number: 0, done: None, context, decoder_context, frames };
        session.reset()?;
        Ok(session)
    }

    fn reset(&mut self) -> Result<()> {
        (self.token, self.done) = (0, None);
        let (past, q) = (self.p.flow.past, self.p.decoder.past);
        self.context.bias.fill(MASKED);
        self.context.bias[past] = 0.0;
        self.context.bias[past + 2 + past..].fill(0.0);
        self.decoder_context.bias.fill(MASKED);
        for row in 0..TOKENS {
            self.decoder_context.bias[row * (q + TOKENS) + q..][..=row].fill(0.0);
        }
        for i in 0..self.p.idle {
            let z = self.p.idle_latents[i * self.p.latent..][..self.p.latent].to_vec();
            if self.done.is_some() {
                self.evaluate(z.clone(), i, false)?;
            }
            self.finish(z, i)?;
        }
        Ok(())
    }

    /// Decodes and remembers the latent of a token whose conditioning is row `i`.
    fn finish(&mut self, z: Vec<f32>, i: usize) -> Result<()> {
        let latent: Vec<f32> = z.iter().zip(&self.p.std).zip(&self.p.mean).map(|((z, s), m)| z * s + m).collect();
        phases(&mut self.decoder_context, TOKENS * self.token, self.p.decoder.head_dim());
        let (q, at) = (self.p.decoder.past, TOKENS * self.token % self.p.decoder.past);
        self.nets.decoder(&latent, &self.decoder_context, at, &mut self.frames)?;
        for row in 0..TOKENS {
            self.decoder_context.bias[row * (q + TOKENS) + at..][..TOKENS].fill(0.0);
        }
        self.done = Some((z, i));
        self.token += 1;
        Ok(())
    }

    /// The midpoint rule from `start`, its last step as two of Euler's, for the token of row `i`.
    fn evaluate(&mut self, mut start: Vec<f32>, i: usize, sample: bool) -> Result<Vec<f32>> {
        let (latent, width, n) = (self.p.latent, self.p.flow.width, self.p.evaluations);
        let Some((z_done, i_done)) = self.done.take() else { return Err("no token is finished".into()) };
        let (past, position) = (self.p.flow.past, self.token - 1);
        let at = position % past;
        phases(&mut self.context, position, self.p.flow.head_dim());
        self.context.bias[past + 2 + at] = MASKED;
        let mut cond = vec![0.0; 4 * width];
        for branch in 0..2 {
            for (row, token) in [i_done, i].into_iter().enumerate() {
                let from = &self.p.cond[(2 * token + branch) * width..][..width];
                cond[(2 * branch + row) * width..][..width].copy_from_slice(from);
            }
        }
        let mut z = start.clone();
        let (mut rows, mut x1) = (vec![0.0; 2 * latent], vec![0.0; 2 * latent]);
        let step = 2.0 / n as f32;
        for slot in 0..n {
            let tau = slot as f32 / n as f32;
            let eps = &self.p.eps[i_done * latent..][..latent];
            for ((row, z), eps) in rows.iter_mut().zip(&z_done).zip(eps) {
                *row = tau * z + (1.0 - tau) * eps;
            }
            rows[latent..].copy_from_slice(&z);
            self.nets.flow(slot, &rows, &cond, &self.context, at, &mut x1)?;
            if sample {
                let k = if slot % 2 == 0 { 0.5 * step } else { step } / (1.0 - tau);
                for (c, z) in z.iter_mut().enumerate() {
                    let guided = x1[c] + self.p.guidance * (x1[latent + c] - x1[c]);
                    *z = if slot + 1 == n { guided } else { start[c] + k * (guided - *z) };
                }
                if slot % 2 == 1 {
                    start.copy_from_slice(&z);
                }
            }
        }
        self.context.bias[at] = 0.0;
        self.context.bias[past + 2 + at] = 0.0;
        self.done = Some((z_done, i_done));
        Ok(z)
    }

    fn step(&mut self, number: usize) -> Result<Vec<f32>> {
        let i = self.p.idle + number % self.p.blocks;
        let eps = self.p.eps[i * self.p.latent..][..self.p.latent].to_vec();
        let z = self.evaluate(eps, i, true)?;
        self.finish(z.clone(), i)?;
        Ok(z)
    }
}

/// Rotary phases of consecutive positions from `first`.
fn phases(context: &mut Context, first: usize, head_dim: usize) {
    let half = head_dim / 2;
    for (i, (cos, sin)) in context.cos.iter_mut().zip(&mut context.sin).enumerate() {
        let angle = (first + i / half) as f64 * 10_000f64.powf(-((i % half) as f64) / half as f64);
        (*cos, *sin) = (angle.cos() as f32, angle.sin() as f32);
    }
}

impl<N: Networks> Blocks for Session<N> {
    fn check(&mut self) -> Result<(Vec<f32>, Vec<f32>)> {
        self.reset()?;
        let (mut latents, mut decoded) = (Vec::new(), Vec::new());
        for number in 0..self.p.blocks {
            latents.extend(self.step(number)?);
            decoded.extend_from_slice(&self.frames);
        }
        Ok((latents, decoded))
    }

    fn block(&mut self) -> Result<f64> {
        let started = Instant::now();
        self.step(self.number)?;
        self.number += 1;
        Ok(1000.0 * started.elapsed().as_secs_f64())
    }
}
