//! Linear layers: plain weights in, packed weights for one level out.

use half::f16;

use super::Kernels;
use super::matmul_f32_f16::MatmulF32F16;
use super::matmul_f32_f32::MatmulF32F32;
use super::matmul_i8dx_i4g::{self, MatmulI8I4};
use super::matmul_i8dx_i8cx::{self, MatmulI8I8};
use super::operation::{Kernel, Operation};
use super::packed::{Buffer, FloatGeometry, MAX_PANELS, NR, PrefetchTarget, TILE_COLS};
use super::weights::{WeightData, Weights};
use crate::scheme::Scheme;

/// A linear layer packed for one CPU level: weights, scales and bias.
pub struct Matrix {
    /// What [`Activations`](super::Activations) know it by; empty for none.
    pub(super) name: String,
    pub(super) out: usize,
    pub(super) cols: usize,
    /// Padded with zeros to whole panels, as are the scales.
    pub(super) bias: Vec<f32>,
    pub(super) body: Body,
    /// Whether integer weights are multiplied with int16 activations: rows are split in two.
    pub(super) split: bool,
}

/// Packed weights, where each lies, and the kernel that they are packed for.
pub(super) struct Packed<O: Operation, G> {
    pub(super) buffer: Buffer,
    pub(super) geo: G,
    pub(super) kernel: Kernel<O>,
}

pub(super) enum Body {
    F32(Packed<MatmulF32F32, FloatGeometry>),
    F16(Packed<MatmulF32F16, FloatGeometry>),
    /// With the scale of each output.
    I8(Packed<MatmulI8I8, matmul_i8dx_i8cx::Geometry>, Vec<f32>),
    I4(Packed<MatmulI8I4, matmul_i8dx_i4g::Geometry>),
}

impl Matrix {
    pub(super) fn pack(kernels: &Kernels, w: Weights<'_>, bias: Option<&[f32]>) -> Matrix {
        let Weights { rows, cols, data } = w;
        assert!(rows > 0 && cols > 0, "pack: a layer has inputs and outputs");
        let padded_rows = rows.next_multiple_of(NR);
        let panels = padded_rows / NR;
        let pad = |v: &[f32]| {
            assert_eq!(v.len(), rows, "pack: one bias, and one scale, for each output");
            let mut v = v.to_vec();
            v.resize(padded_rows, 0.0);
            v
        };
        let bias = bias.map_or_else(|| vec![0.0; padded_rows], pad);
        let body = match data {
            WeightData::F32(w) => {
                let geo = FloatGeometry::new(cols, 4);
                Body::F32(Packed { buffer: pack_floats(w, rows, cols, &geo, panels), geo, kernel: kernels.f32 })
            }
            // No instruction widens half floats there, so it is done once.
            WeightData::F16(w) if cfg!(target_family = "wasm") => {
                let geo = FloatGeometry::new(cols, 4);
                let w = w.iter().map(|w| w.to_f32()).collect::<Vec<_>>();
                Body::F32(Packed { buffer: pack_floats(&w, rows, cols, &geo, panels), geo, kernel: kernels.f32 })
            }
            WeightData::F16(w) => {
                let geo = FloatGeometry::new(cols, 2);
                Body::F16(Packed { buffer: pack_floats(w, rows, cols, &geo, panels), geo, kernel: kernels.f16 })
            }
            WeightData::I8 { q, scale } => {
                assert_eq!(q.len(), rows * cols, "pack: rows * cols values");
                let geo = matmul_i8dx_i8cx::Geometry::new(cols, *kernels.i8.about());
                let mut buffer = Buffer::new(panels * geo.panel);
                each_panel(buffer.of_mut::<u8>(), geo.panel, |p, panel| {
                    geo.pack(&q[p * NR * cols..rows.min((p + 1) * NR) * cols], cols, panel);
                });
                Body::I8(Packed { buffer, geo, kernel: kernels.i8 }, pad(scale))
            }
            WeightData::I4 { q, scale } => {
                let geo = matmul_i8dx_i4g::Geometry::new(cols);
                Body::I4(Packed { buffer: pack_nibbles(q, scale, rows, cols, &geo, panels), geo, kernel: kernels.i4 })
            }
        };
        Matrix { name: String::new(), out: rows, cols, bias, body, split: false }
    }

    /// The same matrix with a name for [`Activations`](super::Activations).
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        name.clone_into(&mut self.name);
        self
    }

    /// The same matrix for int16 activations instead of int8 (W8A16, W4A16), where its weights are
    /// integers: twice the multiplications, the same bytes, 1/254 of the activations' rounding.
    /// Float weights take floats as they come either way.
    #[must_use]
    pub fn with_int16_activations(mut self) -> Self {
        self.split = matches!(self.body, Body::I8(..) | Body::I4(..));
        self
    }

    /// Bits that activations are rounded to: 8 or 16; `None` for float weights, which take floats.
    pub fn activation_bits(&self) -> Option<u8> {
        match self.body {
            Body::F32(..) | Body::F16(..) => None,
            Body::I8(..) | Body::I4(..) => Some(if self.split { 16 } else { 8 }),
        }
    }

    /// Length of a row of results.
    pub fn out_features(&self) -> usize {
        self.out
    }

    /// Length of a row of activations.
    pub fn in_features(&self) -> usize {
        self.cols
    }

    /// Bytes in memory: packed weights, scales and bias.
    pub fn bytes(&self) -> usize {
        4 * self.bias.len()
            + match &self.body {
                Body::F32(w) => w.buffer.bytes(),
                Body::F16(w) => w.buffer.bytes(),
                Body::I8(w, scale) => w.buffer.bytes() + 4 * scale.len(),
                Body::I4(w) => w.buffer.bytes(),
            }
    }

    /// Where the threads begin to read integer weights: one at the first tile, the other at the
    /// last.
    pub(super) fn ends(&self) -> Option<[PrefetchTarget; 2]> {
        let (weights, panel) = match &self.body {
            Body::F32(..) | Body::F16(..) => return None,
            Body::I8(w, _) => (w.buffer.of::<u8>(), w.geo.panel),
            Body::I4(w) => (w.buffer.of::<u8>(), w.geo.panel),
        };
        let last = (self.out - 1) / TILE_COLS * MAX_PANELS * panel;
        Some([0, last].map(|at| PrefetchTarget::new(weights, at, panel)))
    }

    /// Scheme of the packed weights: where floats have to be widened by hand, f16 is packed as f32.
    pub fn scheme(&self) -> Scheme {
        match &self.body {
            Body::F32(..) => Scheme::F32,
            Body::F16(..) => Scheme::F16,
            Body::I8(..) => Scheme::I8,
            Body::I4(..) => Scheme::I4,
        }
    }
}

impl std::fmt::Debug for Matrix {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Matrix({} x {} {})", self.out, self.cols, self.scheme())
    }
}

/// Calls `pack` with the number and the memory of each panel of `size` values. One thread does it:
/// nobody has said how many there may be when an engine is made, and memory is the limit.
fn each_panel<T>(values: &mut [T], size: usize, pack: impl Fn(usize, &mut [T])) {
    values.chunks_exact_mut(size).enumerate().for_each(|(p, panel)| pack(p, panel));
}

fn pack_floats<T: super::packed::Plain>(
    w: &[T],
    rows: usize,
    cols: usize,
    geo: &FloatGeometry,
    panels: usize,
) -> Buffer {
    assert_eq!(w.len(), rows * cols, "pack: rows * cols values");
    let mut buffer = Buffer::new(panels * geo.panel * size_of::<T>());
    each_panel(buffer.of_mut::<T>(), geo.panel, |p, panel| {
        for (lane, row) in w[p * NR * cols..rows.min((p + 1) * NR) * cols].chunks_exact(cols).enumerate() {
            for (part, segment) in row.chunks(geo.seg).zip(panel.chunks_exact_mut(geo.seg_stride)) {
                part.iter().zip(segment.chunks_exact_mut(NR)).for_each(|(v, column)| column[lane] = *v);
            }
        }
    });
    buffer
}

fn pack_nibbles(
    q: &[u8],
    scale: &[f16],
    rows: usize,
    cols: usize,
    geo: &matmul_i8dx_i4g::Geometry,
    panels: usize,
) -> Buffer {
    let stride = cols.div_ceil(2);
    assert_eq!(q.len(), rows * stride, "pack: rows * ceil(cols / 2) bytes");
    assert_eq!(scale.len(), rows * geo.groups, "pack: rows * ceil(cols / 32) scales");
    let mut buffer = Buffer::new(panels * geo.panel);
    each_panel(buffer.of_mut::<u8>(), geo.panel, |p, panel| {
        matmul_i8dx_i4g::Geometry::pack(&q[p * NR * stride..rows.min((p + 1) * NR) * stride], cols, panel);
    });
    let scales = buffer.of_mut::<f16>();
    for (r, row) in scale.chunks_exact(geo.groups).enumerate() {
        for (g, &s) in row.iter().enumerate() {
            scales[geo.scale_at(r, g)] = s;
        }
    }
    buffer
}
