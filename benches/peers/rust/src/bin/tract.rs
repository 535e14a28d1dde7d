//! tract: the exported ONNX files, optimised, f32. `tract FOLDER tract-f32 THREADS`: matrix
//! products on rayon's threads where there are two.

use std::sync::Arc;
use tract_onnx::prelude::*;
use visavis_peers::Result;
use visavis_peers::session::{Context, Networks, Prepared, Session, Stack, TOKENS};
use visavis_peers::worker::serve;

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, _variant, threads] = args.as_slice() else { return Err("usage: tract FOLDER VARIANT THREADS".into()) };
    let threads: usize = threads.parse()?;
    if threads > 1 {
        tract_linalg::multithread::set_default_executor(tract_linalg::multithread::Executor::multithread(threads));
    }
    let p = Prepared::read(folder)?;
    let plan = |name: &str| -> Result<Arc<TypedSimplePlan>> {
        Ok(tract_onnx::onnx().model_for_path(format!("{folder}/{name}.onnx"))?.into_optimized()?.into_runnable()?)
    };
    let width = p.flow.width;
    let modulation = p.modulation.iter().map(|m| tensor(&[m.len() / width, width], m)).collect::<Result<_>>()?;
    let nets = Nets {
        flow: plan("flow")?,
        decoder: plan("decoder")?,
        modulation,
        slots: (0..p.modulation.len()).map(|_| Ring::new(p.flow, 2)).collect::<Result<_>>()?,
        ring: Ring::new(p.decoder, 1)?,
    };
    serve(&mut Session::new(p, nets)?)
}

struct Nets {
    flow: Arc<TypedSimplePlan>,
    decoder: Arc<TypedSimplePlan>,
    modulation: Vec<TValue>,
    slots: Vec<Ring>,
    ring: Ring,
}

/// Keys `[branches, heads, head_dim, past]`, then values `[branches, heads, past, head_dim]`, of
/// each layer. Runs only borrow them.
struct Ring {
    stack: Stack,
    branches: usize,
    tensors: Vec<Tensor>,
}

fn tensor(shape: &[usize], values: &[f32]) -> Result<TValue> {
    Ok(Tensor::from_shape(shape, values)?.into_tvalue())
}

impl Ring {
    fn new(stack: Stack, branches: usize) -> Result<Self> {
        let (h, hd, p) = (stack.heads, stack.head_dim(), stack.past);
        let zeros = |shape: [usize; 4]| Ok(Tensor::zero::<f32>(&shape)?);
        let shapes = [[branches, h, hd, p], [branches, h, p, hd]];
        let tensors = shapes.into_iter().flat_map(|s| (0..stack.layers).map(move |_| s)).map(zeros);
        Ok(Self { stack, branches, tensors: tensors.collect::<Result<_>>()? })
    }

    /// Runs `plan`; the first output into `out`, the others' `rows` new rows to places `at ..`.
    fn run(
        &mut self,
        plan: &Arc<TypedSimplePlan>,
        inputs: Vec<TValue>,
        rows: usize,
        at: usize,
        out: &mut [f32],
    ) -> Result<()> {
        // The tensors are lent to the run and taken back: nothing is copied.
        let lent: Vec<TValue> = self.tensors.drain(..).map(IntoTValue::into_tvalue).collect();
        let outputs = plan.run(inputs.into_iter().chain(lent.iter().cloned()).collect())?;
        self.tensors = lent.into_iter().map(|t| t.into_tensor()).collect();
        let floats =
            |i: usize| -> Result<Vec<f32>> { Ok(outputs[i].to_plain_array_view::<f32>()?.iter().copied().collect()) };
        out.copy_from_slice(&floats(0)?);
        let (layers, hd, past) = (self.stack.layers, self.stack.head_dim(), self.stack.past);
        let (keys, values) = (floats(1)?, floats(2)?);
        let heads = self.branches * self.stack.heads;
        for (i, tensor) in self.tensors.iter_mut().enumerate() {
            let mut plain = tensor.try_as_plain_ram_mut()?;
            let cache = plain.as_slice_mut::<f32>()?;
            let layer = i % layers;
            for head in 0..heads {
                let from = (layer * heads + head) * hd * rows;
                for (c, row) in (0..hd).flat_map(|c| (0..rows).map(move |row| (c, row))) {
                    if i < layers {
                        cache[(head * hd + c) * past + at + row] = keys[from + c * rows + row];
                    } else {
                        cache[(head * past + at + row) * hd + c] = values[from + row * hd + c];
                    }
                }
            }
        }
        Ok(())
    }
}

fn context(stack: &Stack, rows: usize, c: &Context) -> Result<[TValue; 3]> {
    let half = stack.head_dim() / 2;
    Ok([
        tensor(&[rows, 1, half], &c.cos)?,
        tensor(&[rows, 1, half], &c.sin)?,
        tensor(&[rows, stack.past + rows], &c.bias)?,
    ])
}

impl Networks for Nets {
    fn flow(&mut self, slot: usize, z: &[f32], cond: &[f32], c: &Context, at: usize, x1: &mut [f32]) -> Result<()> {
        let ring = &mut self.slots[slot];
        let [cos, sin, bias] = context(&ring.stack, 2, c)?;
        let z = tensor(&[2, z.len() / 2], z)?;
        let cond = tensor(&[2, 2, ring.stack.width], cond)?;
        ring.run(&self.flow, vec![z, cond, self.modulation[slot].clone(), cos, sin, bias], 1, at, x1)
    }

    fn decoder(&mut self, z: &[f32], c: &Context, at: usize, frames: &mut [f32]) -> Result<()> {
        let [cos, sin, bias] = context(&self.ring.stack, TOKENS, c)?;
        let z = tensor(&[1, z.len()], z)?;
        self.ring.run(&self.decoder, vec![z, cos, sin, bias], TOKENS, at, frames)
    }
}
