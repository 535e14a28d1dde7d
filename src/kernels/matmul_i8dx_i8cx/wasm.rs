//! Products of bytes as the engine has them: by `relaxed_dot`, whose second operand is signed or
//! unsigned (then weights are offset by 128, as in the AVX-512 variant), or of pairs of 16 bits.

use std::arch::wasm32::*;

use super::{Job, NR, Tile};
use crate::kernels::packed::for_blocks;
use crate::kernels::quantize_rows::GROUP;
#[cfg(target_feature = "relaxed-simd")]
use crate::kernels::wasm::{Dot, dot};

/// A way to add products of bytes to lanes of 32 bits: sixteen weights with four activations, which
/// each lane has.
trait Bytes: Copy {
    type Weights: Copy;
    type X: Copy;
    /// Rows of one panel whose accumulators fit the registers.
    const ROOM: usize;
    /// What the products come out too large by, times the activation.
    const OFFSET: i32;

    fn weights(self, w: v128) -> Self::Weights;
    fn x(self, x: v128) -> Self::X;
    fn add(self, sum: v128, w: Self::Weights, x: Self::X) -> v128;
}

/// Even and odd bytes of a word, widened to 16 bits: `dot_i16x8` adds two products of each.
#[derive(Clone, Copy)]
struct Pairs;

impl Bytes for Pairs {
    type Weights = [v128; 2];
    type X = [v128; 2];
    const ROOM: usize = 2;
    const OFFSET: i32 = 0;

    #[inline(always)]
    fn weights(self, w: v128) -> [v128; 2] {
        [i16x8_shr(i16x8_shl(w, 8), 8), i16x8_shr(w, 8)]
    }

    #[inline(always)]
    fn x(self, x: v128) -> [v128; 2] {
        self.weights(x)
    }

    #[inline(always)]
    fn add(self, sum: v128, w: [v128; 2], x: [v128; 2]) -> v128 {
        i32x4_add(sum, i32x4_add(i32x4_dot_i16x8(w[0], x[0]), i32x4_dot_i16x8(w[1], x[1])))
    }
}

/// `relaxed_dot` where it takes the second operand as signed or, with `UNSIGNED`, as unsigned.
#[cfg(target_feature = "relaxed-simd")]
#[derive(Clone, Copy)]
struct Relaxed<const UNSIGNED: bool>;

#[cfg(target_feature = "relaxed-simd")]
impl<const UNSIGNED: bool> Bytes for Relaxed<UNSIGNED> {
    type Weights = v128;
    type X = v128;
    const ROOM: usize = 3;
    const OFFSET: i32 = if UNSIGNED { 128 } else { 0 };

    #[inline(always)]
    fn weights(self, w: v128) -> v128 {
        if UNSIGNED { v128_xor(w, i8x16_splat(-128)) } else { w }
    }

    #[inline(always)]
    fn x(self, x: v128) -> v128 {
        x
    }

    #[inline(always)]
    fn add(self, sum: v128, w: v128, x: v128) -> v128 {
        i32x4_relaxed_dot_i8x16_i7x16_add(x, w, sum)
    }
}

pub(super) fn exact(job: &Job<'_>, tile: &mut Tile<i32>) {
    run(Pairs, job, tile);
}

#[cfg(target_feature = "relaxed-simd")]
pub(super) fn relaxed(job: &Job<'_>, tile: &mut Tile<i32>) {
    match dot() {
        Dot::Signed => run(Relaxed::<false>, job, tile),
        Dot::Unsigned => run(Relaxed::<true>, job, tile),
        Dot::Seven => run(Pairs, job, tile),
    }
}

fn run<B: Bytes>(bytes: B, job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    for_blocks!(
        0..job.x.rows, job.panels.count, B::ROOM, R in [1 2 3 4], P in [1],
        |r, p| block::<B, R>(bytes, job, r, p, tile)
    );
}

/// Rows `row .. row + R` of panel `p` of the job.
#[inline(never)]
fn block<B: Bytes, const R: usize>(bytes: B, job: &Job<'_>, row: usize, p: usize, tile: &mut Tile<i32>) {
    let (padded, stride) = (job.geo.padded, job.x.stride);
    let weights = job.weights[(job.panels.first + p) * job.geo.panel..][..NR * padded].as_ptr();
    let q = job.x.q[row * stride..][..R * stride].as_ptr();
    let groups = padded / GROUP;
    let mut acc = [[i32x4_splat(0); 4]; R];
    if B::OFFSET != 0 {
        for r in 0..R {
            let sum: i32 = job.x.sums[(row + r) * groups..][..groups].iter().sum();
            acc[r] = [i32x4_splat(-B::OFFSET * sum); 4];
        }
    }
    // Sixteen columns at a time.
    for k in (0..padded).step_by(16) {
        for j in 0..4 {
            let mut x = [bytes.x(i32x4_splat(0)); R];
            for r in 0..R {
                // SAFETY: 4 bytes at column k + 4 j of row r, within R rows, `stride` apart.
                x[r] = bytes.x(unsafe { v128_load32_splat(q.add(r * stride + k + 4 * j).cast()) });
            }
            for i in 0..4 {
                // SAFETY: 16 of the 64 bytes of columns k + 4 j .. k + 4 j + 4 of the panel.
                let w = bytes.weights(unsafe { v128_load(weights.add(NR * k + 64 * j + 16 * i).cast()) });
                for r in 0..R {
                    acc[r][i] = bytes.add(acc[r][i], w, x[r]);
                }
            }
        }
    }
    for r in 0..R {
        let out = &mut tile[row + r][p * NR..][..NR];
        for i in 0..4 {
            // SAFETY: 16 values at `out`.
            unsafe { v128_store(out.as_mut_ptr().add(4 * i).cast(), acc[r][i]) };
        }
    }
}
