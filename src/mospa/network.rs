//! The denoiser: an encoder-only transformer from a noisy motion, what both ears hear, where it
//! comes from, the sensitivity and the diffusion step to the clean motion.

use super::pose::motion_size;
use super::{Heard, UNKNOWN};
use crate::audio::ears::HEAD_HEIGHT;
use crate::audio::features::SIZE;
use crate::bundle::Tensors;
use crate::config::MospaConfig;
use crate::error::Result;
use crate::kernels::{Epilogue, Exec, Kernels, KvCache, KvDtype, Matrix, Span};
use crate::nn::{Affine, Layer, Pass, PlainNorms, Rope, Sizes};
use crate::normaliser::{Metric, Normaliser, Standardised};

/// Standardised features are within.
const LIMIT: f32 = 8.0;
/// Tokens before the patches: step, sensitivity, source.
const LEAD: usize = 3;
/// Numbers of a source: direction, logarithm of the distance, whether it is known.
const SOURCE: usize = 5;

/// Weights and statistics.
#[derive(Debug)]
pub(super) struct Network {
    config: MospaConfig,
    pub(super) motion: Normaliser,
    features: Normaliser,
    steps: [Matrix; 2],
    sources: [Matrix; 2],
    audio_in: Matrix,
    motion_in: Matrix,
    out: Matrix,
    genres: Vec<f32>,
    slots: Vec<f32>,
    /// Of each patch's number, `[P, W]`.
    waves: Vec<f32>,
    layers: Vec<Layer>,
    norms: PlainNorms,
    rope: Rope,
}

/// Working memory of one clip, and its tokens that no step changes.
#[derive(Debug)]
pub(super) struct Work {
    exec: Exec,
    pass: Pass,
    cache: KvCache,
    spans: Vec<Span>,
    /// Genre and source, `[2, W]`.
    given: Vec<f32>,
    /// What each patch is told beside its motion and the step, `[P, W]`.
    told: Vec<f32>,
}

/// `[cos n f_0 .. cos n f_(h-1), sin ..]` with `f_i = 10000^(-i / h)`, half of the width each.
fn wave(n: usize, width: usize) -> Vec<f32> {
    let half = width / 2;
    let angle = |i: usize| f64::from(n as f32 * libm::pow(10_000.0, -(i as f64) / half as f64) as f32);
    let cos = (0..half).map(|i| libm::cos(angle(i)) as f32);
    cos.chain((0..half).map(|i| libm::sin(angle(i)) as f32)).collect()
}

/// What the network is told of a source in the character's frame; zeros where it is unknown.
fn source_row(place: Option<[f32; 3]>) -> [f32; SOURCE] {
    let Some([x, y, z]) = place else { return [0.0; SOURCE] };
    let d = [x, y - HEAD_HEIGHT as f32, z];
    let r = (d.iter().map(|v| v * v).sum::<f32>() + 0.01).sqrt();
    [d[0] / r, d[1] / r, d[2] / r, libm::logf(r), 1.0]
}

fn add(to: &mut [f32], from: &[f32]) {
    to.iter_mut().zip(from).for_each(|(a, b)| *a += b);
}

impl Network {
    pub(super) fn load(t: &Tensors<'_>, kernels: Kernels, c: &MospaConfig, joints: usize) -> Result<Self> {
        let (w, d) = (c.width, motion_size(joints));
        let linear = |name: &str, outputs, inputs| t.linear(kernels, &format!("mospa.{name}"), outputs, &[inputs]);
        let affine = |name: &str| -> Result<Affine> {
            let part = |part| t.f32(&format!("mospa.{name}.{part}"), &[w]);
            Ok(Affine::new(&part("bias")?, &part("weight")?))
        };
        let stats = |name: &str, width| {
            let part = |part| t.f32(&format!("stats.{name}_{part}"), &[width]);
            Normaliser::new(&format!("stats.{name}"), part("mean")?, part("std")?)
        };
        let (mut layers, mut norms) = (Vec::with_capacity(c.layers), Vec::with_capacity(c.layers));
        for i in 0..c.layers {
            let name = |part: &str| format!("layers.{i}.{part}");
            layers.push(Layer {
                qkv: linear(&name("qkv"), 3 * w, w)?,
                proj: linear(&name("proj"), w, w)?,
                fc1: linear(&name("fc1"), c.mlp * w, w)?,
                fc2: linear(&name("fc2"), w, c.mlp * w)?,
            });
            norms.push([affine(&name("ln1"))?, affine(&name("ln2"))?]);
        }
        Ok(Self {
            config: *c,
            motion: stats("motion", d)?,
            features: stats("feature", SIZE)?,
            steps: [linear("step1", w, w)?, linear("step2", w, w)?],
            sources: [linear("source1", w, SOURCE)?, linear("source2", w, w)?],
            audio_in: linear("audio", w, c.patch * 2 * SIZE)?,
            motion_in: linear("motion", w, c.patch * d)?,
            out: linear("out", c.patch * d, w)?,
            genres: t.f32("mospa.genre", &[UNKNOWN + 1, w])?,
            slots: t.f32("mospa.slots", &[4, w])?,
            waves: (0..c.frames / c.patch).flat_map(|k| wave(k, w)).collect(),
            layers,
            norms: PlainNorms { layers: norms, last: affine("ln_f")? },
            rope: Rope::new(w / c.heads),
        })
    }

    /// Bytes of the packed matrices.
    pub(super) fn bytes(&self) -> usize {
        let single = self.steps.iter().chain(&self.sources).chain([&self.audio_in, &self.motion_in, &self.out]);
        single.map(Matrix::bytes).sum::<usize>() + self.layers.iter().map(Layer::bytes).sum::<usize>()
    }

    /// Numbers of a clip's motion.
    pub(super) fn size(&self) -> usize {
        self.config.frames * self.motion.width()
    }

    fn patches(&self) -> usize {
        self.config.frames / self.config.patch
    }

    fn slot(&self, i: usize) -> &[f32] {
        &self.slots[i * self.config.width..][..self.config.width]
    }

    /// Memory for a clip, in which `heard` is known.
    pub(super) fn work(&self, kernels: Kernels, threads: usize, heard: &Heard<'_>) -> Result<Work> {
        let MospaConfig { width: w, heads, mlp, patch, .. } = self.config;
        let (patches, widest) = (self.patches(), (patch * self.motion.width()).max(patch * 2 * SIZE).max(w * mlp));
        let tokens = LEAD + patches;
        let mut exec = Exec::new(kernels, threads, widest)?;
        let mut given = vec![0.0; 2 * w];
        let (genre, source) = given.split_at_mut(w);
        let chosen = heard.genre.map_or(UNKNOWN, usize::from).min(UNKNOWN);
        genre.copy_from_slice(&self.genres[chosen * w..][..w]);
        add(genre, self.slot(1));
        let mut hidden = vec![0.0; w];
        exec.linear(&self.sources[0], &source_row(heard.place), 1, &mut hidden, Epilogue::Gelu);
        exec.linear(&self.sources[1], &hidden, 1, source, Epilogue::Store);
        add(source, self.slot(2));
        let mut told = vec![0.0; patches * w];
        exec.linear(&self.audio_in, &self.ears(heard), patches, &mut told, Epilogue::Store);
        for (patch, wave) in told.chunks_exact_mut(w).zip(self.waves.chunks_exact(w)) {
            for part in [wave, self.slot(3), genre, source] {
                add(patch, part);
            }
        }
        Ok(Work {
            exec,
            pass: Pass::new(Sizes { width: w, heads, hidden: w * mlp }, tokens, &self.rope),
            cache: KvCache::new(1, tokens, heads, w, KvDtype::F32),
            spans: vec![Span { ring: 0, first: 0, len: tokens as u32 }; tokens],
            given,
            told,
        })
    }

    /// Standardised features, frame by frame the left ear's and the right ear's.
    fn ears(&self, heard: &Heard<'_>) -> Vec<f32> {
        let mut out = Vec::with_capacity(2 * self.config.frames * SIZE);
        let mut row = Standardised::zeros(SIZE);
        for (left, right) in heard.left.chunks_exact(SIZE).zip(heard.right.chunks_exact(SIZE)) {
            for ear in [left, right] {
                self.features.standardise(Metric::new(ear), row.view_mut());
                out.extend(row.values().iter().map(|v| v.clamp(-LIMIT, LIMIT)));
            }
        }
        out
    }

    /// The clean motion, standardised, `[T, D]`, of the noisy `x` at diffusion step `time`.
    ///
    /// # Panics
    /// When lengths are not those of a clip.
    pub(super) fn clean(&self, work: &mut Work, x: &[f32], time: usize, out: &mut [f32]) {
        assert!(x.len() == self.size() && out.len() == self.size(), "a clip's motion");
        let (w, patches) = (self.config.width, self.patches());
        let tokens = LEAD + patches;
        let Work { exec, pass, cache, spans, given, told } = work;
        pass.clear();
        for _ in 0..tokens {
            // Position 0 turns nothing: tokens know their time from their waves.
            pass.push(&self.rope, 0, 0);
        }
        let mut hidden = vec![0.0; w];
        exec.linear(&self.steps[0], &wave(time, w), 1, &mut hidden, Epilogue::Store);
        exec.silu(&mut hidden);
        let mut step = vec![0.0; w];
        exec.linear(&self.steps[1], &hidden, 1, &mut step, Epilogue::Store);
        add(&mut step, self.slot(0));
        pass.input(0..1).copy_from_slice(&step);
        pass.input(1..LEAD).copy_from_slice(given);
        let motion = pass.input(LEAD..tokens);
        exec.linear(&self.motion_in, x, patches, motion, Epilogue::Store);
        add(motion, told);
        motion.chunks_exact_mut(w).for_each(|patch| add(patch, &step));
        pass.run(exec, &self.layers, &self.norms, None, &mut |exec, _, qkv, out| {
            for (i, row) in qkv.chunks_exact(3 * w).enumerate() {
                cache.write(0, i as u64, &row[w..2 * w], &row[2 * w..]);
            }
            exec.attend(qkv, 3 * w, cache, spans, out);
        });
        pass.read(exec, &self.norms, LEAD..tokens);
        pass.project(exec, &self.out, out);
    }
}
