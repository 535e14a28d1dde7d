//! `Exec` as networks use it: against plain loops in f64, and the same bits for each level and
//! number of threads.

use half::f16;

use super::testing::{Random, bits, levels};
use super::*;
use crate::error::ErrorKind;

struct Case {
    rows: usize,
    cols: usize,
    out: usize,
}

const CASES: [Case; 7] = [
    Case { rows: 1, cols: 1, out: 1 },
    Case { rows: 2, cols: 37, out: 5 },
    Case { rows: 3, cols: 64, out: 64 },
    Case { rows: 4, cols: 130, out: 200 },
    Case { rows: 5, cols: 256, out: 129 },
    Case { rows: 16, cols: 33, out: 48 },
    Case { rows: 37, cols: 96, out: 70 },
];

/// Weights, and whether activations are int16 instead of int8.
const SCHEMES: [(&str, bool); 6] =
    [("f32", false), ("f16", false), ("i8", false), ("i8", true), ("i4", false), ("i4", true)];

/// A layer in one scheme, with the values that its weights stand for.
struct Layer {
    f32: Vec<f32>,
    f16: Vec<f16>,
    i8: Vec<i8>,
    i4: Vec<u8>,
    scale: Vec<f32>,
    group_scale: Vec<f16>,
}

impl Layer {
    fn new(random: &mut Random, rows: usize, cols: usize) -> Self {
        let f32 = random.floats(rows * cols, 0.1);
        Self {
            f16: f32.iter().map(|&v| f16::from_f32(v)).collect(),
            f32,
            i8: random.bytes(rows * cols),
            i4: random.bytes(rows * cols.div_ceil(2)).into_iter().map(|v| v as u8).collect(),
            scale: random.floats(rows, 0.001).into_iter().map(f32::abs).collect(),
            group_scale: random.floats(rows * cols.div_ceil(32), 0.02).into_iter().map(f16::from_f32).collect(),
        }
    }

    fn data(&self, scheme: &str) -> WeightData<'_> {
        match scheme {
            "f32" => WeightData::F32(&self.f32),
            "f16" => WeightData::F16(&self.f16),
            "i8" => WeightData::I8 { q: &self.i8, scale: &self.scale },
            _ => WeightData::I4 { q: &self.i4, scale: &self.group_scale },
        }
    }

    fn value(&self, scheme: &str, cols: usize, r: usize, c: usize) -> f64 {
        let at = r * cols + c;
        match scheme {
            "f32" => self.f32[at].into(),
            "f16" => self.f16[at].to_f64(),
            "i8" => f64::from(self.i8[at]) * f64::from(self.scale[r]),
            _ => {
                let n = self.i4[r * cols.div_ceil(2) + c / 2] >> (4 * (c % 2)) & 15;
                (f64::from(n) - 8.0) * self.group_scale[r * cols.div_ceil(32) + c / 32].to_f64()
            }
        }
    }
}

#[test]
fn linear_matches_f64_and_has_the_same_bits_everywhere() {
    let mut random = Random(1);
    for Case { rows, cols, out } in CASES {
        let layer = Layer::new(&mut random, out, cols);
        let bias = random.floats(out, 1.0);
        let x = random.floats(rows * cols, 2.0);
        let y0 = random.floats(rows * out, 1.0);
        let gates = random.floats(3 * (out + 7), 1.0);
        let index: Vec<u32> = (0..rows).map(|_| random.below(3) as u32).collect();
        let gate = RowTable { table: &gates, stride: out + 7, offset: 7, index: &index };
        for (scheme, split) in SCHEMES {
            for e in [Epilogue::Store, Epilogue::Gelu, Epilogue::Add, Epilogue::GatedAdd(gate)] {
                let mut first: Option<Vec<u32>> = None;
                for kernels in levels() {
                    let mut m = kernels.pack(Weights { rows: out, cols, data: layer.data(scheme) }, Some(&bias));
                    if split {
                        m = m.with_int16_activations();
                    }
                    let bits_of_x = scheme.starts_with('i').then_some(if split { 16 } else { 8 });
                    assert_eq!(m.activation_bits(), bits_of_x);
                    assert_eq!(
                        (m.out_features(), m.in_features(), m.scheme().to_string().as_str()),
                        (out, cols, scheme)
                    );
                    for threads in [1, 2] {
                        let mut exec = Exec::new(kernels, threads, cols).unwrap();
                        let mut y = y0.clone();
                        exec.begin();
                        exec.linear(&m, &x, rows, &mut y, e);
                        exec.end();
                        let first = first.get_or_insert_with(|| bits(&y));
                        assert_eq!(*first, bits(&y), "{scheme} {split} {rows}x{cols}x{out} {exec:?}");
                        check(&layer, (scheme, split), &x, (rows, cols, out), &bias, &y0, e, &y);
                    }
                }
            }
        }
    }
}

#[allow(clippy::too_many_arguments, reason = "operands of one product")]
fn check(
    layer: &Layer,
    (scheme, split): (&str, bool),
    x: &[f32],
    (rows, cols, out): (usize, usize, usize),
    bias: &[f32],
    y0: &[f32],
    e: Epilogue<'_>,
    y: &[f32],
) {
    for r in 0..rows {
        let x = &x[r * cols..][..cols];
        let top = x.iter().fold(0.0f32, |m, v| m.max(v.abs()));
        for c in 0..out {
            let (mut sum, mut size) = (f64::from(bias[c]), 1.0);
            for k in 0..cols {
                let w = layer.value(scheme, cols, c, k);
                sum += f64::from(x[k]) * w;
                size += w.abs();
                // Quantised activations are off by half a step each.
                if scheme.starts_with('i') {
                    size += 1e5 * w.abs() * f64::from(top) / if split { 32258.0 } else { 127.0 };
                }
            }
            let at = r * out + c;
            let want = match e {
                Epilogue::Store => sum,
                Epilogue::Gelu => {
                    0.5 * sum * (1.0 + ((2.0 / std::f64::consts::PI).sqrt() * (sum + 0.044715 * sum.powi(3))).tanh())
                }
                Epilogue::Add => f64::from(y0[at]) + sum,
                Epilogue::GatedAdd(gate) => f64::from(y0[at]) + f64::from(gate.part(r, c, 1)[0]) * sum,
            };
            assert!((f64::from(y[at]) - want).abs() < 6e-6 * size, "{scheme} {e:?} ({r},{c}): {} for {want}", y[at]);
        }
    }
}

/// Scales at the ends of what floats hold, rows of zeros among huge and denormal ones, slices that
/// begin anywhere.
#[test]
fn extreme_scales_have_the_same_bits_everywhere() {
    let mut random = Random(7);
    for (cols, out) in [(33, 17), (96, 70)] {
        let (q, x) = (random.bytes(out * cols), random.floats(6 * cols + 1, 1.0));
        let nibbles: Vec<u8> = random.bytes(out * cols.div_ceil(2)).into_iter().map(|v| v as u8).collect();
        let scale: Vec<f32> = (0..out).map(|r| [0.0, 1e-45, 1e-38, 1.0, 1e30][r % 5]).collect();
        let group_scale: Vec<f16> =
            (0..out * cols.div_ceil(32)).map(|i| f16::from_f32([0.0, 6e-8, -1.0, 65504.0][i % 4])).collect();
        let sizes = [0.0, 1e-40, 1e-30, 1.0, 1e30, 3e38];
        let x: Vec<f32> =
            std::iter::once(0.0).chain(x[1..].iter().enumerate().map(|(i, v)| v * sizes[i / cols])).collect();
        let data = [WeightData::I8 { q: &q, scale: &scale }, WeightData::I4 { q: &nibbles, scale: &group_scale }];
        for (data, split) in data.into_iter().flat_map(|data| [(data, false), (data, true)]) {
            let mut first: Option<Vec<u32>> = None;
            for kernels in levels() {
                let m = kernels.pack(Weights { rows: out, cols, data }, None);
                let m = if split { m.with_int16_activations() } else { m };
                let mut exec = Exec::new(kernels, 1, cols).unwrap();
                let mut y = vec![0.5; 6 * out];
                exec.linear(&m, &x[1..], 6, &mut y, Epilogue::Store);
                assert!(y[..out].iter().all(|v| *v == 0.0), "a row of zeros gives zeros: {exec:?}");
                // What is not a number has many bit patterns.
                let y: Vec<u32> = y.iter().map(|v| if v.is_nan() { u32::MAX } else { v.to_bits() }).collect();
                assert_eq!(*first.get_or_insert_with(|| y.clone()), y, "{exec:?}");
            }
        }
    }
}

#[test]
fn zero_and_broken_rows() {
    for kernels in levels() {
        let (q, scale) = ([-128i8; 40], [f32::MAX / 1e6]);
        let m =
            kernels.pack(Weights { rows: 1, cols: 40, data: WeightData::I8 { q: &q, scale: &scale } }, Some(&[3.0]));
        let mut exec = Exec::new(kernels, 1, 40).unwrap();
        let mut x = [0.0; 120];
        x[40] = 1e-38;
        x[90] = f32::NAN;
        let mut y = [0.0; 3];
        exec.linear(&m, &x, 3, &mut y, Epilogue::Store);
        assert_eq!(y[..2], [3.0, 3.0], "a zero row and a denormal one give the bias");
        assert!(y[2].is_nan(), "a NaN is not hidden");
    }
}

#[test]
fn attention_matches_f64_over_wrapped_rings() {
    let mut random = Random(2);
    for (heads, head_dim, capacity, len) in
        [(1, 1, 1, 1), (2, 24, 7, 5), (4, 64, 100, 100), (4, 16, 150, 131), (3, 5, 4, 0)]
    {
        let dim = heads * head_dim;
        let (rows, stride) = (6, dim * 3);
        let q = random.floats(rows * stride, 3.0);
        let last = capacity as u64 * 3 + 2;
        for dtype in [KvDtype::F16, KvDtype::F32] {
            let mut cache = KvCache::new(3, capacity, heads, dim, dtype);
            let mut tokens = Vec::new();
            for position in 0..=last {
                let (k, v) = (random.floats(dim, 1.0), random.floats(dim, 1.0));
                cache.write(1, position, &k, &v);
                cache.copy_token(1, 2, position);
                tokens.push((k, v));
            }
            let spans: Vec<Span> = (0..rows)
                .map(|r| {
                    let len = len.min(1 + r * 30).min(len);
                    Span { ring: 1 + (r % 2) as u32, first: last + 1 - len as u64, len: len as u32 }
                })
                .collect();
            let mut first: Option<Vec<u32>> = None;
            for kernels in levels() {
                for threads in [1, 2] {
                    let mut exec = Exec::new(kernels, threads, dim).unwrap();
                    let mut y = vec![9.0; rows * dim];
                    exec.begin();
                    exec.attend(&q, stride, &cache, &spans, &mut y);
                    exec.end();
                    let first = first.get_or_insert_with(|| bits(&y));
                    assert_eq!(*first, bits(&y), "{dtype:?} {exec:?}");
                    for (r, span) in spans.iter().enumerate() {
                        for h in 0..heads {
                            let q = &q[r * stride + h * head_dim..][..head_dim];
                            let want =
                                naive(q, &tokens[span.first as usize..][..span.len as usize], h * head_dim, dtype);
                            for (got, want) in y[r * dim + h * head_dim..].iter().zip(want) {
                                assert!((f64::from(*got) - want).abs() < 3e-6, "{got} for {want}");
                            }
                        }
                    }
                }
            }
        }
    }
}

fn naive(q: &[f32], tokens: &[(Vec<f32>, Vec<f32>)], offset: usize, dtype: KvDtype) -> Vec<f64> {
    let stored = |v: f32| if dtype == KvDtype::F16 { f16::from_f32(v).to_f64() } else { v.into() };
    let scores: Vec<f64> = tokens
        .iter()
        .map(|(k, _)| {
            let dot: f64 = q.iter().zip(&k[offset..]).map(|(&q, &k)| f64::from(q) * stored(k)).sum();
            (dot / (q.len() as f64).sqrt()).exp()
        })
        .collect();
    let total: f64 = scores.iter().sum();
    (0..q.len())
        .map(|i| tokens.iter().zip(&scores).map(|((_, v), s)| s / total * stored(v[offset + i])).sum())
        .collect()
}

#[test]
fn norm_and_rope_take_a_vector_for_each_row() {
    let mut random = Random(3);
    let (rows, dim, heads, head_dim) = (5, 40, 2, 16);
    let x = random.floats(rows * dim, 4.0);
    let table = random.floats(3 * 2 * dim, 1.0);
    let index = [2, 0, 1, 1, 2];
    let shift = RowTable { table: &table, stride: 2 * dim, offset: 0, index: &index };
    let scale = RowTable { table: &table, stride: 2 * dim, offset: dim, index: &index };
    let angles = random.floats(rows * head_dim / 2, 3.0);
    let cos: Vec<f32> = angles.iter().map(|a| a.cos()).collect();
    let sin: Vec<f32> = angles.iter().map(|a| a.sin()).collect();
    for kernels in levels() {
        let mut exec = Exec::new(kernels, 1, dim).unwrap();
        let mut y = vec![0.0; rows * dim];
        exec.norm(&x, rows, dim, shift, scale, &mut y);
        let mut z = x.clone();
        exec.rope(&mut z, rows, dim, heads, head_dim, &cos, &sin);
        for r in 0..rows {
            let row: Vec<f64> = x[r * dim..][..dim].iter().map(|&v| v.into()).collect();
            let mean = row.iter().sum::<f64>() / dim as f64;
            let var = row.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / dim as f64;
            for i in 0..dim {
                let entry = &table[index[r] as usize * 2 * dim..];
                let want = (row[i] - mean) / (var + 1e-5).sqrt() * f64::from(entry[dim + i]) + f64::from(entry[i]);
                assert!((f64::from(y[r * dim + i]) - want).abs() < 2e-6);
                let want = if i < heads * head_dim {
                    let (j, second) = (i % (head_dim / 2), i % head_dim >= head_dim / 2);
                    let a = f64::from(angles[r * head_dim / 2 + j]);
                    let other = if second { row[i - head_dim / 2] } else { -row[i + head_dim / 2] };
                    row[i] * a.cos() + other * a.sin()
                } else {
                    row[i]
                };
                assert!((f64::from(z[r * dim + i]) - want).abs() < 2e-6);
            }
        }
    }
}

#[test]
fn sessions_can_move_between_threads() {
    fn send<T: Send>() {}
    fn sync<T: Sync>() {}
    send::<Exec>();
    send::<KvCache>();
    send::<Matrix>();
    sync::<Matrix>();
    sync::<Kernels>();
}

#[test]
fn a_wrong_number_of_threads_is_an_argument_error() {
    let kernels = Kernels::with_level(Level::Scalar).unwrap();
    for threads in [0, 3] {
        let e = Exec::new(kernels, threads, 1).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::Argument);
    }
}
