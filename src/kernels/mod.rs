//! Arithmetic of the networks: skinny matrix products, attention, normalisation, activations, polar factors.
//!
//! One folder an operation, each of the same make:
//!
//! | file | holds |
//! |---|---|
//! | `mod.rs` | the contract: the formula, the shapes, what slices must hold, how packed data lies; and `VARIANTS`, the one table of variants |
//! | `scalar.rs` | the reference: plain Rust that defines every bit of the result |
//! | `avx2.rs`, `neon.rs`, ... | one variant each, named after the level that it needs |
//! | `tests.rs` | every entry of the table that this CPU can run against the reference, with random shapes, tails, unaligned slices and extremes; then what the reference itself must do |
//!
//! | operation | computes | for |
//! |---|---|---|
//! | `matmul_f32_f32`, `matmul_f32_f16` | x W', float weights | bundles of floats, and layers that are kept so |
//! | `matmul_i8dx_i8cx` | the same of int8 rows (`i8dx`: quantised per row as they come) and int8 weights (`i8cx`: a scale a channel) | nearly all weights of int8 bundles |
//! | `matmul_i8dx_i4g` | the same with int4 weights, a scale for a group of 32 columns | nearly all weights of int4 bundles |
//! | `quantize_rows` | rows of activations to int8 | both of those |
//! | `split_rows` | rows of activations to int16, as two rows of int8 | both, for layers whose activations int8 is too coarse for |
//! | `epilogue` | what follows a product: scales, bias, then store, GELU, or addition to the residual stream, gated or not | every product |
//! | `norm` | layer normalisation with AdaLN's shift and scale | flow, autoencoder |
//! | `rope` | rotary positions | queries and keys |
//! | `attend` | attention over rings of cached keys and values, softmax included; rows of one ring read them together | flow, autoencoder |
//! | `gelu` | GELU and SiLU by themselves | embedding of the flow time |
//! | `fold` (one file) | a product of float matrices in f64 | two layers that become one when a bundle is loaded |
//! | `polar` | nearest rotations of 3x3 matrices | all joints of a frame |
//!
//! To read one, open `matmul_i8dx_i8cx/mod.rs`, then its `scalar.rs`, one variant, `tests.rs`; the others follow. `cargo test --lib kernels::OPERATION` tests one,
//! `cargo bench --bench kernels` times all. From a layer to its kernel: [`Kernels::detect`] picks an entry of each table,
//! [`Kernels::pack`] lays a layer's weights out for it (a [`Matrix`]), and [`Exec::linear`] cuts a product into tiles of 64 outputs, which threads take:
//! sums by the product's variant, then the epilogue while the tile is in the first-level cache. A new variant is a file with a function of
//! the table's type and a line in the table; no list of tests is to be kept, because tests iterate the tables, so none can be listed untested.
//!
//! **Same bits everywhere.** Every variant of every operation gives the bits of the scalar reference: integer sums are
//! exact, and each float operation fixes its order of summation (16 lanes, folded by halves) and where it uses a fused
//! multiply-add (correctly rounded on every CPU, in software at the scalar level). So a session replays bit for bit on
//! another level, on another architecture, and with another number of threads.
//!
//! **Unsafe.** A variant is an `unsafe fn` for one reason: it may be called only on a CPU that has its level. [`Kernels`] and [`Matrix`] exist only for
//! levels that were found here, which is what each call's `SAFETY` line says. Inside, variants check their operands (`check`, asserts on lengths) before
//! the first pointer is made.
//!
//! Kernels do not allocate, lock, or look at the environment; they take slices whose lengths the callers in this
//! module have checked, and [`Exec`] owns threads and scratch.
//!
//! A level that the CPU lacks is compiled and neither run nor tested there; tests and benches take what is available.
//! aarch64 levels are tested under emulation (`cortex-a57`: NEON, `cortex-a76`: and dotprod, `max`: and i8mm).

#![allow(clippy::needless_range_loop, reason = "tiles are indexed by row, panel and lane side by side")]

mod activations;
mod attend;
mod epilogue;
mod exec;
#[cfg(test)]
mod exec_tests;
mod fold;
mod gelu;
mod interleave;
mod lanes;
mod level;
mod linear;
mod math;
mod matmul_f32_f16;
mod matmul_f32_f32;
mod matmul_i8dx_i4g;
mod matmul_i8dx_i8cx;
mod matrix;
mod norm;
mod packed;
mod polar;
mod quantize_rows;
mod rope;
mod split_rows;
#[cfg(test)]
mod testing;
mod weights;

pub use crate::scheme::Scheme;
pub use activations::Activations;
pub use attend::{KvCache, KvDtype, Span};
pub use exec::{Exec, Limits, RowTable};
pub use level::Level;
pub use linear::Epilogue;
pub use matrix::Matrix;
pub(crate) use weights::signed;
pub use weights::{I4_GROUP, WeightData, Weights};

use crate::error::{Error, ErrorKind, Result};

/// One implementation of an operation: its name in reports, the level it needs, and what it consists of.
pub(crate) struct Variant<F: 'static> {
    pub(crate) name: &'static str,
    pub(crate) level: Level,
    pub(crate) run: F,
}

/// The best variant that `level` includes; tables list the scalar one first and better ones later.
fn pick<F>(table: &'static [Variant<F>], level: Level) -> &'static Variant<F> {
    table.iter().rev().find(|v| level.includes(v.level)).unwrap_or(&table[0])
}

/// A CPU level and the variant of each operation for it.
///
/// A value exists only for a level that this CPU has: it is the proof that calls into its variants rest on.
#[derive(Clone, Copy)]
pub struct Kernels {
    level: Level,
    f32: &'static Variant<matmul_f32_f32::Run>,
    f16: &'static Variant<matmul_f32_f16::Run>,
    i8: &'static Variant<matmul_i8dx_i8cx::Kernel>,
    i4: &'static Variant<matmul_i8dx_i4g::Run>,
    quantize: &'static Variant<quantize_rows::Run>,
    split: &'static Variant<split_rows::Run>,
    epilogue: &'static Variant<epilogue::Run>,
    attend: &'static Variant<attend::Kernel>,
    norm: &'static Variant<norm::Run>,
    rope: &'static Variant<rope::Run>,
    gelu: &'static Variant<gelu::Kernel>,
    polar: &'static Variant<polar::Run>,
}

impl Kernels {
    /// The best level of this CPU, or the one that the environment variable `VISAVIS_CPU` names
    /// (`scalar`, `neon`, `dotprod`, `i8mm`, `avx2`, `avxvnni`, `avx512`).
    ///
    /// # Errors
    /// [`ErrorKind::CpuLevel`] when it names a level that does not exist or that this CPU lacks; the message lists those available.
    pub fn detect() -> Result<Kernels> {
        let forced = std::env::var_os("VISAVIS_CPU").map(|v| v.to_string_lossy().into_owned());
        Level::choose(forced.as_deref()).map(Self::of)
    }

    /// The kernels of one level, whatever the environment says.
    ///
    /// # Errors
    /// [`ErrorKind::CpuLevel`] when this CPU cannot run `level`.
    pub fn with_level(level: Level) -> Result<Kernels> {
        if level.is_available() {
            return Ok(Self::of(level));
        }
        let list = Self::available().iter().map(|l| l.name()).collect::<Vec<_>>().join(", ");
        Err(Error::new(ErrorKind::CpuLevel, format!("this CPU cannot run level {level}; available here: {list}")))
    }

    /// Callers have checked that `level` is available.
    fn of(level: Level) -> Kernels {
        Kernels {
            level,
            f32: pick(matmul_f32_f32::VARIANTS, level),
            f16: pick(matmul_f32_f16::VARIANTS, level),
            i8: pick(matmul_i8dx_i8cx::VARIANTS, level),
            i4: pick(matmul_i8dx_i4g::VARIANTS, level),
            quantize: pick(quantize_rows::VARIANTS, level),
            split: pick(split_rows::VARIANTS, level),
            epilogue: pick(epilogue::VARIANTS, level),
            attend: pick(attend::VARIANTS, level),
            norm: pick(norm::VARIANTS, level),
            rope: pick(rope::VARIANTS, level),
            gelu: pick(gelu::VARIANTS, level),
            polar: pick(polar::VARIANTS, level),
        }
    }

    /// The levels that this CPU can run, weakest first.
    pub fn available() -> Vec<Level> {
        Level::available()
    }

    /// The level of these kernels.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Operation and variant in use, for reports.
    pub fn variants(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("matmul_f32_f32", self.f32.name),
            ("matmul_f32_f16", self.f16.name),
            ("matmul_i8dx_i8cx", self.i8.name),
            ("matmul_i8dx_i4g", self.i4.name),
            ("quantize_rows", self.quantize.name),
            ("split_rows", self.split.name),
            ("epilogue", self.epilogue.name),
            ("attend", self.attend.name),
            ("norm", self.norm.name),
            ("rope", self.rope.name),
            ("gelu", self.gelu.name),
            ("polar", self.polar.name),
        ]
    }

    /// Packs a linear layer for these kernels; the result is read by an [`Exec`] of any level this CPU has.
    ///
    /// # Panics
    /// When lengths disagree: see [`WeightData`] for what each scheme needs, and `bias` has `w.rows` values.
    pub fn pack(&self, w: Weights<'_>, bias: Option<&[f32]>) -> Matrix {
        Matrix::pack(self, w, bias)
    }

    /// The nearest rotation (row-major 3x3, determinant +1) of each matrix of `m`: the R that maximises tr(R^T m).
    /// Exact for any reflection or rank; a matrix of rank 0 or 1 has many nearest rotations and gets one of them,
    /// a non-finite one gets the identity.
    ///
    /// # Panics
    /// When `m` and `out` differ in length.
    pub fn polar(&self, m: &[[f32; 9]], out: &mut [[f32; 9]]) {
        assert_eq!(m.len(), out.len(), "polar: as many results as matrices");
        // SAFETY: a `Kernels` exists only for a level that this CPU has.
        unsafe { (self.polar.run)(m, out) }
    }
}

impl std::fmt::Debug for Kernels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Kernels").field("level", &self.level).field("variants", &self.variants()).finish()
    }
}
