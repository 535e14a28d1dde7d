//! Tests of the encoder: against the definition, against itself cut up, and against tract.

use super::tests::noise;
use super::*;
use crate::config::{AudioConfig, ConvConfig};
use crate::error::ErrorKind;
use crate::kernels::{Exec, Kernels, WeightData, Weights};
use proptest::prelude::*;

fn config(layers: &[(usize, usize, usize, usize, bool)], features: usize) -> AudioConfig {
    let conv = |&(inputs, outputs, kernel, stride, residual)| ConvConfig { inputs, outputs, kernel, stride, residual };
    AudioConfig { layers: layers.iter().map(conv).collect(), features }
}

/// Overlapping and adjoining windows, a kernel of three strides, a residual layer of kernel 1, odd
/// sizes.
fn small() -> AudioConfig {
    config(
        &[
            (1, 7, 10, 5, false),
            (7, 12, 4, 4, false),
            (12, 20, 24, 8, false),
            (20, 20, 3, 1, true),
            (20, 9, 5, 5, false),
            (9, 9, 1, 1, true),
        ],
        11,
    )
}

/// The shape that bundles have.
#[cfg(feature = "tract")]
fn base() -> AudioConfig {
    config(
        &[
            (1, 24, 10, 5, false),
            (24, 48, 10, 5, false),
            (48, 96, 8, 4, false),
            (96, 160, 8, 4, false),
            (160, 256, 4, 2, false),
            (256, 256, 3, 1, true),
            (256, 256, 3, 1, true),
        ],
        64,
    )
}

/// Weights of a size that keeps signals at about 1: `[rows, cols]` and `[rows]` for each layer, the
/// last for the output.
struct Net(AudioConfig, Vec<(usize, usize, Vec<f32>, Vec<f32>)>);

impl Net {
    fn new(config: AudioConfig) -> Self {
        let mut sizes: Vec<_> = config.layers.iter().map(|c| (c.outputs, c.kernel * c.inputs)).collect();
        sizes.push((config.features, config.layers.last().unwrap().outputs));
        let layer = |(i, (rows, cols)): (usize, (usize, usize))| {
            let scale = (6.0 / cols as f32).sqrt();
            let weights = noise(i as u32 + 1, rows * cols).iter().map(|w| w * scale).collect();
            (rows, cols, weights, noise(i as u32 + 100, rows).iter().map(|b| b * 0.1).collect())
        };
        Self(config, sizes.into_iter().enumerate().map(layer).collect())
    }

    fn layers(&self) -> Vec<LayerWeights<'_>> {
        self.1
            .iter()
            .map(|(rows, cols, w, bias)| LayerWeights {
                weights: Weights { rows: *rows, cols: *cols, data: WeightData::F32(w) },
                bias,
            })
            .collect()
    }

    fn packed(&self, kernels: &Kernels) -> AudioWeights {
        let layers = self.layers();
        let (out, layers) = layers.split_last().unwrap();
        AudioWeights::new(kernels, &self.0, "audio", layers, *out).unwrap()
    }

    /// The definition, in f64, over the whole signal with zeros before it.
    fn reference(&self, samples: &[f32]) -> Vec<f64> {
        let mut x: Vec<f64> = samples.iter().map(|&s| f64::from(s)).collect();
        for (conv, (_, cols, w, bias)) in self.0.layers.iter().zip(&self.1) {
            let rows = x.len() / conv.inputs / conv.stride;
            let left = (conv.kernel - conv.stride) * conv.inputs;
            let mut y = Vec::with_capacity(rows * conv.outputs);
            for t in 0..rows {
                for o in 0..conv.outputs {
                    let mut sum = f64::from(bias[o]);
                    for c in 0..*cols {
                        if let Some(at) = (t * conv.stride * conv.inputs + c).checked_sub(left) {
                            sum += f64::from(w[o * cols + c]) * x[at];
                        }
                    }
                    let inner = (2.0 / std::f64::consts::PI).sqrt() * (sum + 0.044715 * sum.powi(3));
                    let residual = if conv.residual { x[t * conv.inputs + o] } else { 0.0 };
                    y.push(0.5 * sum * (1.0 + inner.tanh()) + residual);
                }
            }
            x = y;
        }
        let (rows, cols, w, bias) = self.1.last().unwrap();
        let row = |x: &[f64], o: usize| -> f64 {
            x.iter().zip(&w[o * cols..]).map(|(x, &w)| x * f64::from(w)).sum::<f64>() + f64::from(bias[o])
        };
        x.chunks(*cols).flat_map(|x| (0..*rows).map(move |o| (x, o))).map(|(x, o)| row(x, o)).collect()
    }
}

fn exec(config: &AudioConfig, threads: usize) -> Exec {
    Exec::new(Kernels::detect().unwrap(), threads, AudioEncoder::width(config)).unwrap()
}

/// Runs `samples` through in pieces of `frames` frames.
fn run(net: &Net, exec: &mut Exec, encoder: &mut AudioEncoder, samples: &[f32], frames: &[usize]) -> Vec<f32> {
    let weights = net.packed(&exec.kernels());
    let mut out = vec![f32::NAN; samples.len() / 800 * net.0.features];
    let (mut x, mut y) = (samples, &mut out[..]);
    for n in frames.iter().cycle() {
        if x.is_empty() {
            break;
        }
        let n = (*n).min(x.len() / 800);
        let (now, rest) = x.split_at(n * 800);
        let (features, tail) = std::mem::take(&mut y).split_at_mut(n * net.0.features);
        exec.begin();
        encoder.encode(exec, &weights, now, features);
        exec.end();
        (x, y) = (rest, tail);
    }
    out
}

/// A buzz with a moving pitch and loudness, and a hiss.
fn speech(count: usize) -> Vec<f32> {
    let hiss = noise(77, count);
    let mut phase = 0.0f32;
    (0..count)
        .map(|i| {
            let t = i as f32 / 24_000.0;
            phase = (phase + (120.0 + 30.0 * (5.0 * t).sin()) / 24_000.0).fract();
            let loud = (8.0 * t).sin().max(0.0);
            loud * (0.6 * (2.0 * phase - 1.0) + 0.1 * hiss[i])
        })
        .collect()
}

fn worst(got: &[f32], want: &[f64]) -> f64 {
    assert_eq!(got.len(), want.len());
    got.iter()
        .zip(want)
        .map(|(g, w)| (f64::from(*g) - w).abs())
        .fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
}

#[test]
fn equals_the_definition() {
    let net = Net::new(small());
    let mut samples = speech(800 * 9);
    samples.extend(noise(5, 800 * 2));
    let mut encoder = AudioEncoder::new(&net.0).unwrap();
    let got = run(&net, &mut exec(&net.0, 1), &mut encoder, &samples, &[11]);
    let want = net.reference(&samples);
    let size = want.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let error = worst(&got, &want);
    assert!(size > 0.3 && error < 1e-5, "off by {error} at values up to {size}");
}

#[test]
fn a_frame_hears_nothing_that_comes_after_it() {
    let net = Net::new(small());
    let samples = noise(8, 800 * 6);
    let mut changed = samples.clone();
    changed[800 * 3] += 0.5;
    let mut encoder = AudioEncoder::new(&net.0).unwrap();
    let mut exec = exec(&net.0, 1);
    let a = run(&net, &mut exec, &mut encoder, &samples, &[6]);
    encoder.reset();
    let b = run(&net, &mut exec, &mut encoder, &changed, &[6]);
    let at = 3 * net.0.features;
    assert_eq!(a[..at], b[..at]);
    assert_ne!(a[at..at + net.0.features], b[at..at + net.0.features]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn any_cutting_gives_the_same_bits(frames in prop::collection::vec(1usize..9, 1..6), seed in 1u32..100) {
        let net = Net::new(small());
        let samples = noise(seed, 800 * 13);
        let mut encoder = AudioEncoder::new(&net.0).unwrap();
        let whole = run(&net, &mut exec(&net.0, 1), &mut encoder, &samples, &[13]);
        encoder.reset();
        prop_assert_eq!(run(&net, &mut exec(&net.0, 2), &mut encoder, &samples, &frames), whole);
    }
}

#[test]
fn unfit_configs_and_weights_are_refused() {
    let good = small();
    check_audio_config(&good).unwrap();
    let change = |f: &dyn Fn(&mut AudioConfig)| {
        let mut c = good.clone();
        f(&mut c);
        let e = check_audio_config(&c).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::BundleInvalid);
        assert!(AudioEncoder::new(&c).is_err());
    };
    change(&|c| c.layers[1].stride = 3);
    change(&|c| c.layers[0].stride = 10);
    change(&|c| c.layers[0].kernel = 4);
    change(&|c| c.layers[0].kernel = usize::MAX);
    change(&|c| c.layers[2].inputs = 13);
    change(&|c| c.layers[2].residual = true);
    change(&|c| c.layers[0].outputs = 0);
    change(&|c| c.features = 0);
    change(&|c| c.layers.clear());
    change(&|c| c.layers.truncate(4));

    let net = Net::new(good);
    let layers = net.layers();
    let (out, layers) = layers.split_last().unwrap();
    let kernels = Kernels::detect().unwrap();
    let refused = |layers: &[LayerWeights<'_>], out| {
        let e = AudioWeights::new(&kernels, &net.0, "audio", layers, out).unwrap_err();
        assert_eq!(e.kind(), ErrorKind::BundleInvalid);
    };
    refused(&layers[1..], *out);
    refused(layers, layers[0]);
    refused(layers, LayerWeights { bias: &[], ..*out });
    let short = Weights { data: WeightData::F32(&[0.0; 5]), ..out.weights };
    refused(layers, LayerWeights { weights: short, ..*out });
}

#[cfg(feature = "tract")]
#[test]
fn tract_agrees() {
    for net in [Net::new(small()), Net::new(base())] {
        let mut samples = speech(3_200 * 8);
        samples.extend(noise(6, 3_200 * 4));
        let mut encoder = AudioEncoder::new(&net.0).unwrap();
        let ours = run(&net, &mut exec(&net.0, 1), &mut encoder, &samples, &[1, 3]);
        let layers = net.layers();
        let (out, layers) = layers.split_last().unwrap();
        let mut tract = TractEncoder::new(&net.0, layers, *out).unwrap();
        // A second signal after a reset, so that nothing of the first remains.
        for _ in 0..2 {
            let mut theirs = vec![f32::NAN; ours.len()];
            let (first, rest) = theirs.split_at_mut(3 * 4 * net.0.features);
            tract.encode(&samples[..3 * 3_200], first).unwrap();
            tract.encode(&samples[3 * 3_200..], rest).unwrap();
            let theirs: Vec<f64> = theirs.iter().map(|&v| f64::from(v)).collect();
            let size = ours.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            let error = worst(&ours, &theirs);
            assert!(size > 0.3 && error < 1e-5, "{error} apart at values up to {size}");
            tract.reset().unwrap();
        }
    }
}
