//! Arithmetic of the networks: skinny matrix products, attention, normalisation, activations, polar
//! factors.
//!
//! One folder per operation, each of the same make:
//!
//! | file | holds |
//! |---|---|
//! | `mod.rs` | the contract: formula, shapes, packed layout; its declaration, `operation!` |
//! | `scalar.rs` | the reference: plain Rust that defines every bit of the result |
//! | `simd.rs` | the operation on any level that has [`f32x16`] |
//! | `avx2.rs`, `i8mm.rs`, ... | one hand-written variant each, named after its level |
//! | `wasm.rs` | one for both levels of WebAssembly, for any `wasm::Madd` |
//! | `tests.rs` | `cases` for all variants: random shapes, tails, extremes; what the reference must do |
//!
//! | operation | computes |
//! |---|---|
//! | `matmul_f32_f32`, `matmul_f32_f16` | x W', float weights |
//! | `matmul_i8dx_i8cx` | x W' of int8 rows, scaled per row, and int8 weights, scaled per channel |
//! | `matmul_i8dx_i4g` | x W' of int8 rows and weights of int4, one scale per group of 32 columns |
//! | `quantize_rows` | rows of activations to int8 |
//! | `split_rows` | rows to int16, as two rows of int8 each, where int8 is too coarse |
//! | `epilogue` | what follows a product: scales, bias, then store, GELU or (gated) addition |
//! | `norm` | layer normalisation with AdaLN's shift and scale |
//! | `rope` | rotary positions of queries and keys |
//! | `attend` | attention over rings of cached keys and values, softmax included |
//! | `gelu` | GELU and SiLU by themselves |
//! | `lstm_cell` | a row of LSTM cells, from the sums of their gates |
//! | `tanh_distance` | tanh of the distance of two vectors, value by value |
//! | `fold` (one file) | a product in f64: two layers become one when a bundle is loaded |
//! | `polar` | nearest rotations of 3x3 matrices: all joints of a frame |
//!
//! To read one, open `matmul_i8dx_i8cx/mod.rs`, then its `scalar.rs`, one variant, `tests.rs`; the
//! others follow. `cargo test --lib kernels::OPERATION` tests one, `cargo bench --bench kernels`
//! times all.
//!
//! **From a layer to its kernel.** [`Kernels::detect`] picks the best variant of each operation,
//! [`Kernels::pack`] lays a layer's weights out for it (a [`Matrix`]), and [`Exec::linear`] cuts a
//! product into tiles of 64 outputs, which threads take (`linear.rs`): sums by the product's
//! variant, then the epilogue while the tile is in the first-level cache. What a variant covers at
//! once, so many rows and panels as its registers hold, is said by `for_blocks!` (`packed.rs`).
//!
//! **Adding a kernel.** For one more level of an operation, either name the level in the line of
//! its `operation!` that compiles the scalar body, or the `simd` one; or write a file with a
//! function `run` under `#[target_feature]` and give it a line of its own. The compiler refuses a
//! function that asks for more than its level has, and `variants_have_the_bits_of_the_reference`
//! takes it up without further ado: what is declared is tested, wherever a CPU has the level. For a
//! new operation, write a folder of that make and name the operation in `kernels!` below.
//!
//! **Adding a CPU.** A level is a variant of [`Level`] with its name, and a line of `features!`
//! (`level.rs`): its architecture and the features that are both looked for and compiled for. A
//! level that includes another uses its variants until it has its own, so that is all it takes to
//! begin. With vectors of floats it gets a [`token`](level::token) and an implementation of
//! [`F32x16`](f32x16::F32x16), named then in the `simd` lines of the float products and of
//! attention; with products of int8, a variant of both integer products, and the
//! [`Layout`](matmul_i8dx_i8cx::Layout) of weights that it reads.
//!
//! **WebAssembly.** Features are a whole module's (`-Ctarget-feature`): a module is built for
//! [`Level::Simd128`] or for [`Level::Relaxed`], which has the variants of both, and the host takes
//! the one that its engine validates. What relaxed instructions compute is the engine's choice, so
//! the one that is used, `relaxed_madd`, is tried when the level is looked for, and the exact level
//! is used where it is not fused. `web/kernels_check.sh` runs the tests there.
//!
//! **Same bits everywhere.** Every variant of every operation gives the bits of the scalar
//! reference: integer sums are exact, and each float operation fixes its order of summation (16
//! lanes, folded by halves) and where it uses a fused multiply-add (correctly rounded on every CPU,
//! in software at the scalar level). So a session replays bit for bit on another level, on another
//! architecture, and with another number of threads.
//!
//! **Unsafe.** Code that is compiled for a level may run only where the CPU has it. Two proofs
//! carry that: an [`Available`] level, which a [`Kernel`] is picked by, and a token, which only
//! code that is compiled for its level can make. The two calls that rest on them are in the macros
//! `operation!` and `compiled!`. What else is `unsafe` reads and writes memory behind bounds that
//! the operation's `check` has asserted, or is an instruction without a stable intrinsic.
//!
//! **Words.** A *lane* is one of 16 places side by side in a vector or a panel; a *group* is 32
//! columns that share a sum or a scale; a *batch*, rows that attend together; a *head*, one of
//! attention's; a *panel*, 16 outputs of packed weights; a *tile*, the results of up to 16 rows and
//! 4 panels.
//!
//! Kernels do not allocate, lock, or look at the environment; they take slices whose lengths the
//! callers in this module have checked, and [`Exec`] owns threads and scratch.
//!
//! A level that the CPU lacks is compiled and neither run nor tested there; tests and benches take
//! what is available. aarch64 levels are tested under emulation (`cortex-a57`: NEON, `cortex-a76`:
//! and dotprod, `max`: and i8mm).

#![allow(clippy::needless_range_loop, reason = "tiles are indexed by row, panel and lane side by side")]

mod activations;
mod attend;
mod epilogue;
mod exec;
#[cfg(test)]
mod exec_tests;
mod f32x16;
mod fold;
mod gelu;
mod interleave;
mod level;
mod linear;
mod lstm_cell;
mod math;
mod matmul_f32_f16;
mod matmul_f32_f32;
mod matmul_i8dx_i4g;
mod matmul_i8dx_i8cx;
mod matrix;
mod norm;
mod operation;
mod packed;
mod polar;
mod quantize_rows;
mod rope;
mod rows;
mod split_rows;
mod tanh_distance;
#[cfg(any(test, feature = "kernel-tests"))]
mod testing;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
mod wasm;
mod weights;
mod workers;

pub use crate::scheme::Scheme;
pub use activations::Activations;
pub use attend::{KvCache, KvDtype, Span};
pub use exec::Exec;
pub use level::Level;
pub use linear::Epilogue;
pub use matrix::Matrix;
pub use rows::RowTable;
#[cfg(any(test, feature = "kernel-tests"))]
pub use testing::Agreement;
pub(crate) use weights::signed;
pub use weights::{I4_GROUP, WeightData, Weights};

use crate::error::Result;
use level::Available;
use operation::{Kernel, Operation};

/// Declares [`Kernels`]: the kernel of each operation.
macro_rules! kernels {
    ($($field:ident: $module:ident::$operation:ident,)+) => {
        /// A CPU level and the best variant of each operation for it.
        ///
        /// A value exists only for a level that this CPU has.
        #[derive(Clone, Copy)]
        pub struct Kernels {
            level: Level,
            $($field: Kernel<$module::$operation>,)+
        }

        impl Kernels {
            fn of(available: Available) -> Kernels {
                Kernels { level: available.level(), $($field: Kernel::best(available),)+ }
            }

            /// Operation and level of the variant in use, for reports.
            pub fn variants(&self) -> Vec<(&'static str, &'static str)> {
                vec![$((<$module::$operation>::NAME, self.$field.level().name())),+]
            }
        }

        /// Each operation, and the test that holds its variants against the scalar one.
        #[cfg(any(test, feature = "kernel-tests"))]
        pub fn agreements() -> Vec<(&'static str, fn() -> Agreement)> {
            vec![$((<$module::$operation>::NAME, $module::agreement::check)),+]
        }
    };
}

kernels! {
    f32: matmul_f32_f32::MatmulF32F32,
    f16: matmul_f32_f16::MatmulF32F16,
    i8: matmul_i8dx_i8cx::MatmulI8I8,
    i4: matmul_i8dx_i4g::MatmulI8I4,
    quantize: quantize_rows::QuantizeRows,
    split: split_rows::SplitRows,
    epilogue: epilogue::FinishRow,
    attend: attend::Attend,
    norm: norm::Norm,
    rope: rope::Rope,
    gelu: gelu::Activate,
    lstm: lstm_cell::LstmCell,
    tanh_distance: tanh_distance::TanhDistance,
    polar: polar::Polar,
    fold: fold::Fold,
}

/// What `web/kernel-tests` runs: the operations' tests, and those of what is below them.
#[cfg(feature = "kernel-tests")]
pub fn other_tests() -> Vec<(&'static str, fn())> {
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    return wasm::TESTS.to_vec();
    #[cfg(not(all(target_arch = "wasm32", target_feature = "simd128")))]
    Vec::new()
}

impl Kernels {
    /// The best level of this CPU, or the one that the environment variable `VISAVIS_CPU` names
    /// (`scalar`, `neon`, `dotprod`, `i8mm`, `avx2`, `avxvnni`, `avx512`, `simd128`, `relaxed`).
    ///
    /// # Errors
    /// [`CpuLevel`](crate::error::ErrorKind::CpuLevel) when it names a level that does not exist or
    /// that this CPU lacks; the message lists those available.
    pub fn detect() -> Result<Kernels> {
        let forced = std::env::var_os("VISAVIS_CPU").map(|v| v.to_string_lossy().into_owned());
        Level::choose(forced.as_deref()).map(Self::of)
    }

    /// The kernels of one level, whatever the environment says.
    ///
    /// # Errors
    /// [`CpuLevel`](crate::error::ErrorKind::CpuLevel) when this CPU cannot run `level`.
    pub fn with_level(level: Level) -> Result<Kernels> {
        let missing = || level::missing(&format!("this CPU cannot run level {level}"));
        Available::new(level).map(Self::of).ok_or_else(missing)
    }

    /// The levels that this CPU can run, weakest first.
    pub fn available() -> Vec<Level> {
        Level::available()
    }

    /// The level of these kernels.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Packs a linear layer for these kernels; the result is read by an [`Exec`] of any level this
    /// CPU has.
    ///
    /// # Panics
    /// When lengths disagree: see [`WeightData`] for what each scheme needs, and `bias` has
    /// `w.rows` values.
    pub fn pack(&self, w: Weights<'_>, bias: Option<&[f32]>) -> Matrix {
        Matrix::pack(self, w, bias)
    }

    /// The nearest rotation (row-major 3x3, determinant +1) of each matrix of `m`: the R that
    /// maximises tr(R^T m). Exact for any reflection or rank; a matrix of rank 0 or 1 has many
    /// nearest rotations and gets one of them, a non-finite one gets the identity.
    ///
    /// # Panics
    /// When `m` and `out` differ in length.
    pub fn polar(&self, m: &[[f32; 9]], out: &mut [[f32; 9]]) {
        assert_eq!(m.len(), out.len(), "polar: as many results as matrices");
        self.polar.run(m, out);
    }
}

impl std::fmt::Debug for Kernels {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Kernels").field("level", &self.level).field("variants", &self.variants()).finish()
    }
}
