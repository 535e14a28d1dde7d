//! A layer of LSTM cells, a step of several sequences at once.

use crate::bundle::Tensors;
use crate::error::Result;
use crate::kernels::{Epilogue, Exec, Kernels, Matrix};

/// Gates i, f, g, o on the input and the hidden row before, side by side: `[4 w, 2 w]`.
///
/// What a sequence remembers is `2 w` values, its cells and then its hidden row.
#[derive(Debug)]
pub struct Lstm(Matrix);

impl Lstm {
    /// Scratch of a step, values for each of `h`.
    pub const SCRATCH: usize = 6;

    /// Reads layer `name` of `w` cells.
    ///
    /// # Errors
    /// As [`Tensors::linear`].
    pub fn load(t: &Tensors<'_>, kernels: Kernels, name: &str, w: usize) -> Result<Self> {
        t.linear(kernels, name, 4 * w, &[2 * w]).map(Self)
    }

    /// Its weights.
    pub fn matrix(&self) -> &Matrix {
        &self.0
    }

    /// One step of the sequences that have a row in `h`, `[rows, w]`: inputs become hidden rows.
    /// `memory` gives the memory of each member that has a row, in order.
    pub fn step<M>(
        &self,
        exec: &mut Exec,
        scratch: &mut [f32],
        h: &mut [f32],
        members: &mut [M],
        memory: impl for<'a> Fn(&'a mut M) -> Option<&'a mut [f32]> + Copy,
    ) {
        let w = self.0.in_features() / 2;
        let (pairs, gates) = scratch[..Self::SCRATCH * h.len()].split_at_mut(2 * h.len());
        let rows = pairs.chunks_exact_mut(2 * w).zip(h.chunks_exact(w));
        for (memory, (pair, x)) in members.iter_mut().filter_map(memory).zip(rows) {
            pair[..w].copy_from_slice(x);
            pair[w..].copy_from_slice(&memory[w..]);
        }
        exec.linear(&self.0, pairs, h.len() / w, gates, Epilogue::Store);
        let rows = gates.chunks_exact(4 * w).zip(h.chunks_exact_mut(w));
        for (memory, (gates, h)) in members.iter_mut().filter_map(memory).zip(rows) {
            let (cells, hidden) = memory.split_at_mut(w);
            exec.lstm(gates, cells, hidden);
            h.copy_from_slice(hidden);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{WeightData, Weights};

    const W: usize = 5;

    /// Numbers between -1 and 1.
    fn drawn(n: usize, seed: f32) -> Vec<f32> {
        (0..n).map(|i| libm::sinf(seed + 1.7 * i as f32)).collect()
    }

    /// Rows that step together have the bits of each alone; those are the formula's.
    #[test]
    fn rows_step_by_themselves() {
        let kernels = Kernels::detect().unwrap();
        let (weights, bias) = (drawn(8 * W * W, 0.3), drawn(4 * W, 0.9));
        let layer =
            Lstm(kernels.pack(Weights { rows: 4 * W, cols: 2 * W, data: WeightData::F32(&weights) }, Some(&bias)));
        let mut exec = Exec::new(kernels, 1, 2 * W).unwrap();
        let mut scratch = vec![0.0; 3 * Lstm::SCRATCH * W];
        // The middle one has no row.
        let mut members = [(true, drawn(2 * W, 2.0)), (false, drawn(2 * W, 3.0)), (true, drawn(2 * W, 4.0))];
        let mut h = drawn(2 * W, 5.0);
        let (before, inputs) = (members.clone(), h.clone());
        layer.step(&mut exec, &mut scratch, &mut h, &mut members, |(takes_part, memory)| {
            takes_part.then_some(&mut memory[..])
        });
        assert_eq!(members[1], before[1]);
        for (row, i) in [0, 2].into_iter().enumerate() {
            let x = &inputs[row * W..(row + 1) * W];
            let (mut alone, mut memory) = (x.to_vec(), before[i].1.clone());
            layer.step(&mut exec, &mut scratch, &mut alone, &mut [&mut memory[..]], |memory| Some(memory));
            assert_eq!((&alone[..], &memory), (&h[row * W..(row + 1) * W], &members[i].1));
            let (cells, hidden) = before[i].1.split_at(W);
            for k in 0..W {
                let gate = |gate: usize| {
                    let row = &weights[(gate * W + k) * 2 * W..][..2 * W];
                    let sum: f32 = row.iter().zip(x.iter().chain(hidden)).map(|(w, v)| w * v).sum();
                    f64::from(sum + bias[gate * W + k])
                };
                let sigmoid = |v: f64| 1.0 / (1.0 + (-v).exp());
                let cell = sigmoid(gate(1)) * f64::from(cells[k]) + sigmoid(gate(0)) * gate(2).tanh();
                let wanted = [cell, sigmoid(gate(3)) * cell.tanh()];
                for (got, wanted) in [memory[k], memory[W + k]].into_iter().zip(wanted) {
                    assert!((f64::from(got) - wanted).abs() < 1e-5, "row {row}, cell {k}: {got}, not {wanted}");
                }
            }
        }
    }
}
