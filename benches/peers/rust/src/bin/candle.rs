//! candle: the same network written on its tensors, linear layers as QMatMul: f32, Q8_0 or Q4_0.
//!
//! `candle FOLDER candle-f32|candle-q8|candle-q4 THREADS`; the threads are rayon's
//! (RAYON_NUM_THREADS).

use candle_core::quantized::{GgmlDType, QMatMul, QTensor};
use candle_core::{D, DType, Device, Module, Tensor};
use std::collections::HashMap;
use visavis_peers::Result;
use visavis_peers::session::{Context, Networks, Prepared, Session, Stack, TOKENS};
use visavis_peers::worker::serve;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, variant, _threads] = args.as_slice() else {
        return Err("usage: candle FOLDER VARIANT THREADS".into());
    };
    let dtype = match variant.as_str() {
        "candle-q8" => GgmlDType::Q8_0,
        "candle-q4" => GgmlDType::Q4_0,
        _ => GgmlDType::F32,
    };
    let prepared = Prepared::read(folder)?;
    let nets = Nets::load(&format!("{folder}/f32.safetensors"), &prepared, dtype)?;
    serve(&mut Session::new(prepared, nets)?)
}

/// `y = W x + b`.
struct Linear {
    weight: QMatMul,
    bias: Option<Tensor>,
}

impl Linear {
    fn run(&self, x: &Tensor) -> candle_core::Result<Tensor> {
        let y = self.weight.forward(x)?;
        self.bias.as_ref().map_or(Ok(y.clone()), |bias| y.broadcast_add(bias))
    }
}

/// Scale and shift of a norm.
struct Norm(Tensor, Tensor);

struct Layer {
    qkv: Linear,
    proj: Linear,
    fc1: Linear,
    fc2: Linear,
    norms: Option<(Norm, Norm)>,
}

/// Keys `[branches, heads, past, head_dim]` and values likewise.
struct Cache(Tensor, Tensor);

struct Nets {
    flow: (Stack, Vec<Layer>),
    decoder: (Stack, Vec<Layer>),
    input: Linear,
    out: Linear,
    latent: Linear,
    tokens: Tensor,
    last: Norm,
    frames: Linear,
    /// A slot each: six vectors a layer, the last two.
    modulation: Vec<Vec<Tensor>>,
    slots: Vec<Vec<Cache>>,
    ring: Vec<Cache>,
}

struct File(HashMap<String, Tensor>);

impl File {
    fn get(&self, name: &str) -> Result<Tensor> {
        Ok(self.0.get(name).ok_or_else(|| format!("{name} is missing"))?.clone())
    }

    fn linear(&self, name: &str, dtype: GgmlDType) -> Result<Linear> {
        quantised(self.get(&format!("{name}.weight"))?, Some(self.get(&format!("{name}.bias"))?), dtype)
    }

    fn norm(&self, name: &str) -> Result<Norm> {
        Ok(Norm(self.get(&format!("{name}.weight"))?, self.get(&format!("{name}.bias"))?))
    }
}

fn quantised(weight: Tensor, bias: Option<Tensor>, dtype: GgmlDType) -> Result<Linear> {
    let weight = match dtype {
        GgmlDType::F32 => QMatMul::Tensor(weight),
        _ => QMatMul::from_qtensor(QTensor::quantize(&weight, dtype)?)?,
    };
    Ok(Linear { weight, bias })
}

impl Nets {
    fn load(path: &str, p: &Prepared, dtype: GgmlDType) -> Result<Self> {
        let file = File(candle_core::safetensors::load(path, &Device::Cpu)?);
        let layers = |prefix: &str, stack: &Stack, norms: bool| -> Result<Vec<Layer>> {
            let layer = |i: usize| -> Result<Layer> {
                let name = |part: &str| format!("{prefix}.layers.{i}.{part}");
                let linear = |part: &str| file.linear(&name(part), dtype);
                let norms = norms.then(|| {
                    Ok::<_, Box<dyn std::error::Error + Send + Sync>>((
                        file.norm(&name("ln1"))?,
                        file.norm(&name("ln2"))?,
                    ))
                });
                Ok(Layer {
                    qkv: linear("qkv")?,
                    proj: linear("proj")?,
                    fc1: linear("fc1")?,
                    fc2: linear("fc2")?,
                    norms: norms.transpose()?,
                })
            };
            (0..stack.layers).map(layer).collect()
        };
        let cache = |stack: &Stack, branches: usize| -> Result<Cache> {
            let zeros =
                || Tensor::zeros((branches, stack.heads, stack.past, stack.head_dim()), DType::F32, &Device::Cpu);
            Ok(Cache(zeros()?, zeros()?))
        };
        let embed = file.get("flow.embed_latent.weight")?;
        let folded = file.get("flow.input.weight")?.narrow(1, 0, embed.dim(0)?)?.contiguous()?.matmul(&embed)?;
        let slot = file.get("vae.decoder.slot")?;
        let frames = slot.narrow(0, 1, 4)?.add(&file.get("vae.decoder.frame_token")?)?;
        let d = p.flow.width;
        let vectors =
            |m: &Vec<f32>| m.chunks_exact(d).map(|v| Ok(Tensor::new(v, &Device::Cpu)?)).collect::<Result<Vec<_>>>();
        Ok(Self {
            flow: (p.flow, layers("flow", &p.flow, false)?),
            decoder: (p.decoder, layers("vae.decoder", &p.decoder, true)?),
            input: quantised(folded, None, dtype)?,
            out: file.linear("flow.final.out", dtype)?,
            latent: file.linear("vae.decoder.latent", dtype)?,
            tokens: Tensor::cat(&[slot.narrow(0, 0, 1)?, frames], 0)?,
            last: file.norm("vae.decoder.ln_f")?,
            frames: file.linear("vae.decoder.out", dtype)?,
            modulation: p.modulation.iter().map(vectors).collect::<Result<_>>()?,
            slots: (0..p.modulation.len())
                .map(|_| (0..p.flow.layers).map(|_| cache(&p.flow, 2)).collect())
                .collect::<Result<_>>()?,
            ring: (0..p.decoder.layers).map(|_| cache(&p.decoder, 1)).collect::<Result<_>>()?,
        })
    }
}

/// Layer norm without weights, then scale and shift.
fn norm(x: &Tensor, scale: &Tensor, shift: &Tensor) -> candle_core::Result<Tensor> {
    let centred = x.broadcast_sub(&x.mean_keepdim(D::Minus1)?)?;
    let deviation = (centred.sqr()?.mean_keepdim(D::Minus1)? + 1e-5)?.sqrt()?;
    centred.broadcast_div(&deviation)?.broadcast_mul(scale)?.broadcast_add(shift)
}

struct Pass<'a> {
    stack: &'a Stack,
    cos: Tensor,
    sin: Tensor,
    bias: Tensor,
    /// Rows whose keys and values enter the ring, and where.
    keep: usize,
    at: usize,
}

impl<'a> Pass<'a> {
    fn new(stack: &'a Stack, context: &Context, rows: usize, keep: usize, at: usize) -> candle_core::Result<Self> {
        let phases = |v: &[f32]| Tensor::from_slice(v, (rows, 1, stack.head_dim() / 2), &Device::Cpu);
        let bias = Tensor::from_slice(&context.bias, (rows, stack.past + rows), &Device::Cpu)?;
        Ok(Self { stack, cos: phases(&context.cos)?, sin: phases(&context.sin)?, bias, keep, at })
    }

    fn turn(&self, x: &Tensor) -> candle_core::Result<Tensor> {
        let half = self.stack.head_dim() / 2;
        let (a, b) = (x.narrow(3, 0, half)?, x.narrow(3, half, half)?);
        let first = (a.broadcast_mul(&self.cos)? - b.broadcast_mul(&self.sin)?)?;
        let second = (a.broadcast_mul(&self.sin)? + b.broadcast_mul(&self.cos)?)?;
        Tensor::cat(&[first, second], 3)
    }

    /// `x` `[branches, rows, width]`, normed; the attention's output before its projection.
    fn attend(&self, layer: &Layer, x: &Tensor, cache: &Cache) -> candle_core::Result<Tensor> {
        let (b, r, _) = x.dims3()?;
        let (heads, hd, past) = (self.stack.heads, self.stack.head_dim(), self.stack.past);
        let qkv = layer.qkv.run(x)?.reshape((b, r, 3, heads, hd))?;
        let part = |i: usize| qkv.narrow(2, i, 1)?.squeeze(2);
        let (q, k, v) = (self.turn(&part(0)?)?, self.turn(&part(1)?)?, part(2)?);
        let across = |t: &Tensor| t.transpose(1, 2)?.contiguous();
        let (q, k, v) = ((across(&q)? * (1.0 / (hd as f64).sqrt()))?, across(&k)?, across(&v)?);
        let scores = Tensor::cat(&[q.matmul(&cache.0.t()?)?, q.matmul(&k.t()?)?], 3)?.broadcast_add(&self.bias)?;
        let exp = scores.broadcast_sub(&scores.max_keepdim(D::Minus1)?)?.exp()?;
        let weights = exp.broadcast_div(&exp.sum_keepdim(D::Minus1)?)?;
        let old = weights.narrow(3, 0, past)?.contiguous()?.matmul(&cache.1)?;
        let new = weights.narrow(3, past, r)?.contiguous()?.matmul(&v)?;
        cache.0.slice_set(&k.narrow(2, 0, self.keep)?.contiguous()?, 2, self.at)?;
        cache.1.slice_set(&v.narrow(2, 0, self.keep)?.contiguous()?, 2, self.at)?;
        (old + new)?.transpose(1, 2)?.contiguous()?.reshape((b, r, heads * hd))
    }
}

fn feed(layer: &Layer, x: &Tensor) -> candle_core::Result<Tensor> {
    layer.fc2.run(&layer.fc1.run(x)?.gelu()?)
}

fn copy(from: &Tensor, to: &mut [f32]) -> Result<()> {
    to.copy_from_slice(&from.flatten_all()?.to_vec1::<f32>()?);
    Ok(())
}

impl Networks for Nets {
    fn flow(
        &mut self,
        slot: usize,
        z: &[f32],
        cond: &[f32],
        context: &Context,
        at: usize,
        x1: &mut [f32],
    ) -> Result<()> {
        let (stack, layers) = &self.flow;
        let pass = Pass::new(stack, context, 2, 1, at)?;
        let z = Tensor::from_slice(z, (2, z.len() / 2), &Device::Cpu)?;
        let mut x = Tensor::from_slice(cond, (2, 2, stack.width), &Device::Cpu)?.broadcast_add(&self.input.run(&z)?)?;
        let modulation = &self.modulation[slot];
        for (i, layer) in layers.iter().enumerate() {
            let m = &modulation[6 * i..6 * i + 6];
            let y = pass.attend(layer, &norm(&x, &m[1], &m[0])?, &self.slots[slot][i])?;
            x = (&x + layer.proj.run(&y)?.broadcast_mul(&m[2])?)?;
            let y = feed(layer, &norm(&x, &m[4], &m[3])?)?;
            x = (&x + y.broadcast_mul(&m[5])?)?;
        }
        let m = &modulation[6 * layers.len()..];
        let last = norm(&x.narrow(1, 1, 1)?.contiguous()?, &m[1], &m[0])?;
        copy(&self.out.run(&last)?, x1)
    }

    fn decoder(&mut self, z: &[f32], context: &Context, at: usize, frames: &mut [f32]) -> Result<()> {
        let (stack, layers) = &self.decoder;
        let pass = Pass::new(stack, context, TOKENS, TOKENS, at)?;
        let first = self.latent.run(&Tensor::from_slice(z, (1, z.len()), &Device::Cpu)?)?;
        let first = (first + self.tokens.narrow(0, 0, 1)?)?;
        let mut x = Tensor::cat(&[first, self.tokens.narrow(0, 1, 4)?], 0)?.unsqueeze(0)?;
        for (layer, cache) in layers.iter().zip(&self.ring) {
            let Some((ln1, ln2)) = &layer.norms else { return Err("the decoder has norms".into()) };
            let y = pass.attend(layer, &norm(&x, &ln1.0, &ln1.1)?, cache)?;
            x = (&x + layer.proj.run(&y)?)?;
            x = (&x + feed(layer, &norm(&x, &ln2.0, &ln2.1)?)?)?;
        }
        let x = norm(&x, &self.last.0, &self.last.1)?;
        copy(&self.frames.run(&x.narrow(1, 1, 4)?.contiguous()?)?, frames)
    }
}
