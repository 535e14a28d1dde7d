//! Products of bytes as the engine has them: of pairs of 16 bits, or by relaxed dot products. What
//! these make of a second operand beyond seven bits is the engine's choice, so each way is tried
//! once against the first ([`way`]): signed bytes, unsigned ones (then weights are offset by 128, as
//! in the AVX-512 variant), or a magnitude, which has seven bits, while the other operand takes the
//! activation's sign.

use std::arch::wasm32::*;
#[cfg(target_feature = "relaxed-simd")]
use std::sync::OnceLock;

use super::{Job, NR, Tile};
use crate::kernels::packed::{MAX_ROWS, for_blocks};
#[cfg(target_feature = "relaxed-simd")]
use crate::kernels::packed::{Panels, PrefetchTarget, TILE_COLS};
#[cfg(target_feature = "relaxed-simd")]
use crate::kernels::quantize_rows::{GROUP, Int8Rows};

/// A way to add products of bytes to lanes of 32 bits: sixteen weights with four activations, which
/// each lane has.
trait Bytes: Copy {
    type Weights: Copy;
    type X: Copy;
    /// Rows of one panel whose accumulators fit the registers.
    const ROOM: usize;

    /// What the sums of row `row` start at.
    fn start(self, job: &Job<'_>, row: usize) -> i32;
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

    #[inline(always)]
    fn start(self, _job: &Job<'_>, _row: usize) -> i32 {
        0
    }

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

    #[inline(always)]
    fn start(self, job: &Job<'_>, row: usize) -> i32 {
        let groups = job.geo.padded / GROUP;
        let sums = &job.x.sums[row * groups..][..groups];
        if UNSIGNED { -128 * sums.iter().sum::<i32>() } else { 0 }
    }

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

/// Relaxed products whatever they take the second operand as: q w is |q| w for an activation q that is
/// not negative, else |q| (-1 - w) and |q| more, which the sums start with. -1 - w is a byte for
/// every w, with its bits the other way round.
#[cfg(target_feature = "relaxed-simd")]
#[derive(Clone, Copy)]
struct Magnitudes;

#[cfg(target_feature = "relaxed-simd")]
impl Bytes for Magnitudes {
    type Weights = v128;
    type X = [v128; 2];
    const ROOM: usize = 2;

    #[inline(always)]
    fn start(self, job: &Job<'_>, row: usize) -> i32 {
        let q = &job.x.q[row * job.x.stride..][..job.geo.padded];
        q.iter().map(|&q| -i32::from(q.min(0))).sum()
    }

    #[inline(always)]
    fn weights(self, w: v128) -> v128 {
        w
    }

    #[inline(always)]
    fn x(self, x: v128) -> [v128; 2] {
        [i8x16_abs(x), i8x16_lt(x, i8x16_splat(0))]
    }

    #[inline(always)]
    fn add(self, sum: v128, w: v128, x: [v128; 2]) -> v128 {
        // A pair of products is at most 2 * 127 * 128 = 32,512.
        let pairs = i16x8_relaxed_dot_i8x16_i7x16(v128_xor(w, x[1]), x[0]);
        i32x4_add(sum, i32x4_extadd_pairwise_i16x8(pairs))
    }
}

pub(super) fn exact(job: &Job<'_>, tile: &mut Tile<i32>) {
    run(Pairs, job, tile);
}

/// Ways to add products of bytes.
#[cfg(target_feature = "relaxed-simd")]
#[derive(Debug, Clone, Copy)]
enum Way {
    Signed,
    Unsigned,
    Magnitudes,
    Pairs,
}

#[cfg(target_feature = "relaxed-simd")]
pub(super) fn relaxed(job: &Job<'_>, tile: &mut Tile<i32>) {
    by(way(), job, tile);
}

#[cfg(target_feature = "relaxed-simd")]
fn by(way: Way, job: &Job<'_>, tile: &mut Tile<i32>) {
    match way {
        Way::Signed => run(Relaxed::<false>, job, tile),
        Way::Unsigned => run(Relaxed::<true>, job, tile),
        Way::Magnitudes => run(Magnitudes, job, tile),
        Way::Pairs => run(Pairs, job, tile),
    }
}

/// The first of the ways that has exact sums here, tried with the very code that will run.
#[cfg(target_feature = "relaxed-simd")]
fn way() -> Way {
    static FOUND: OnceLock<Way> = OnceLock::new();
    *FOUND.get_or_init(|| {
        let ways = [Way::Signed, Way::Unsigned, Way::Magnitudes];
        ways.into_iter().find(|way| is_exact(*way)).unwrap_or(Way::Pairs)
    })
}

/// Whether a way has the sums of pairs of 16 bits, also of the largest bytes side by side.
#[cfg(target_feature = "relaxed-simd")]
fn is_exact(way: Way) -> bool {
    const COLS: usize = 2 * GROUP;
    let geo = super::Geometry::new(COLS, super::Layout::Quads);
    let mut state = 1u32;
    let mut byte = |extremes: [u8; 2]| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let any = (state >> 24) as u8;
        if state & 1 << 16 == 0 { extremes[usize::from(any & 1)] } else { any }
    };
    let mut weights = [0; NR * COLS + 64];
    weights.iter_mut().for_each(|w| *w = byte([0x80, 0x7f]));
    let mut q = [0i8; MAX_ROWS * COLS];
    q.iter_mut().for_each(|q| *q = (byte([0x81, 0x7f]) as i8).max(-127));
    let mut sums = [0; MAX_ROWS * COLS / GROUP];
    for (sum, q) in sums.iter_mut().zip(q.as_chunks::<GROUP>().0) {
        *sum = q.iter().map(|&q| i32::from(q)).sum();
    }
    let panels = Panels { first: 0, count: 1, next: PrefetchTarget::new(&[], 0, 0) };
    (1..=MAX_ROWS).all(|rows| {
        let x = Int8Rows { q: &q, wide: &[], sums: &sums, stride: COLS, rows };
        let job = Job { x, weights: &weights, geo, panels };
        let mut tiles = [[[0; TILE_COLS]; MAX_ROWS]; 2];
        run(Pairs, &job, &mut tiles[0]);
        by(way, &job, &mut tiles[1]);
        tiles[0] == tiles[1]
    })
}

/// The first sum of each row.
type Starts = [i32; MAX_ROWS];

fn run<B: Bytes>(bytes: B, job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    let mut starts = [0; MAX_ROWS];
    for (row, start) in starts[..job.x.rows].iter_mut().enumerate() {
        *start = bytes.start(job, row);
    }
    for_blocks!(
        0..job.x.rows, job.panels.count, B::ROOM, R in [1 2 3 4], P in [1],
        |r, p| block::<B, R>(bytes, job, &starts, (r, p), tile)
    );
}

/// Rows from `from.0`, panel `from.1` of the job.
#[inline(never)]
fn block<B: Bytes, const R: usize>(
    bytes: B,
    job: &Job<'_>,
    starts: &Starts,
    from: (usize, usize),
    tile: &mut Tile<i32>,
) {
    let (padded, stride) = (job.geo.padded, job.x.stride);
    let weights = job.weights[(job.panels.first + from.1) * job.geo.panel..][..NR * padded].as_ptr();
    let q = job.x.q[from.0 * stride..][..R * stride].as_ptr();
    let mut acc = [[i32x4_splat(0); 4]; R];
    for r in 0..R {
        acc[r] = [i32x4_splat(starts[from.0 + r]); 4];
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
        let out = &mut tile[from.0 + r][from.1 * NR..][..NR];
        for i in 0..4 {
            // SAFETY: 16 values at `out`.
            unsafe { v128_store(out.as_mut_ptr().add(4 * i).cast(), acc[r][i]) };
        }
    }
}

#[cfg(any(test, feature = "kernel-tests"))]
pub(in crate::kernels) mod tests {
    use super::super::{Geometry, Layout};
    use super::*;
    use crate::kernels::packed::{Panels, PrefetchTarget, TILE_COLS};
    use crate::kernels::quantize_rows::{GROUP, Int8Rows};
    use crate::kernels::testing::Random;

    /// Also those that are exact here and not taken.
    #[cfg_attr(test, test)]
    pub(in crate::kernels) fn every_way_agrees() {
        let mut random = Random(17);
        for rows in 1..=16 {
            let geo = Geometry::new(96, Layout::Quads);
            let mut weights: Vec<u8> = random.bytes(geo.panel).into_iter().map(|w| w as u8).collect();
            let mut q: Vec<i8> = random.bytes(rows * geo.padded).into_iter().map(|q| q.max(-127)).collect();
            // Extremes next to each other.
            weights[..512].iter_mut().for_each(|w| *w = [128, 127][random.below(2)]);
            q[..32].iter_mut().for_each(|q| *q = [127, -127][random.below(2)]);
            let sums: Vec<i32> = q.chunks(GROUP).map(|g| g.iter().map(|&q| i32::from(q)).sum()).collect();
            let x = Int8Rows { q: &q, wide: &[], sums: &sums, stride: geo.padded, rows };
            let panels = Panels { first: 0, count: 1, next: PrefetchTarget::new(&[], 0, 0) };
            let job = Job { x, weights: &weights, geo, panels };
            let of = |run: &dyn Fn(&Job<'_>, &mut Tile<i32>)| {
                let mut tile = [[7; TILE_COLS]; 16];
                run(&job, &mut tile);
                tile
            };
            let expected = of(&super::super::scalar::run);
            assert!(of(&exact) == expected, "pairs, {rows} rows");
            #[cfg(target_feature = "relaxed-simd")]
            {
                for way in [Way::Signed, Way::Unsigned, Way::Magnitudes].into_iter().filter(|way| is_exact(*way)) {
                    assert!(of(&|job, tile| by(way, job, tile)) == expected, "{way:?}, {rows} rows");
                }
                assert!(of(&relaxed) == expected, "{:?}, {rows} rows", way());
            }
        }
    }
}
