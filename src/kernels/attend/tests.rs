use half::f16;

use super::{Attend, CHUNK, Head, HeadOf, MAX_BATCH, Row};
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

/// What a row sees: first token, length and shift.
type Seen = (usize, usize, usize);

/// Results of a batch with the queries `q`, one after the other, over both storages.
fn run(kernel: Kernel<Attend>, f32: &Head<'_, f32>, f16: &Head<'_, f16>, q: &[f32], seen: &[Seen]) -> [Vec<u32>; 2] {
    [HeadOf::F32(*f32), HeadOf::F16(*f16)].map(|head| {
        // Neither queries nor results lie at a multiple of a register's size.
        let mut y = vec![5.0; q.len() + 1];
        let rows = q.chunks_exact(f32.dim).zip(y[1..].chunks_exact_mut(f32.dim)).zip(seen);
        let mut rows: Vec<_> = rows.map(|((q, y), &(first, len, shift))| Row { q, y, first, len, shift }).collect();
        kernel.run(head, &mut rows);
        bits(&y)
    })
}

pub(super) fn cases(kernel: Kernel<Attend>, results: &mut Results) {
    let mut random = Random(71);
    for head_dim in (1..40).chain([64, 80, 128, 256, 100]) {
        let (capacity, offset) = (1 + random.below(3 * CHUNK), random.below(4));
        let k = random.floats(capacity * head_dim + offset, 2.0);
        let v =
            random.awkward(capacity * head_dim + offset).into_iter().map(|v| v.clamp(-1e3, 1e3)).collect::<Vec<_>>();
        let half = |v: &[f32]| v.iter().map(|&v| f16::from_f32(v)).collect::<Vec<_>>();
        let (k16, v16) = (half(&k), half(&v));
        let f32 = Head { k: &k[offset..], v: &v[offset..], dim: head_dim, capacity };
        let f16 = Head { k: &k16[offset..], v: &v16[offset..], dim: head_dim, capacity };
        for len in [0, 1, capacity / 2, capacity] {
            for scale in [1.0, 1e4] {
                let n = 1 + random.below(MAX_BATCH);
                let q = random.floats(n * head_dim + 1, scale);
                let first = random.below(capacity);
                // The first rows see the same tokens, the others begin and end elsewhere.
                let seen: Vec<Seen> = (0..n)
                    .map(|r| if r < 2 { (0, len) } else { (random.below(9), random.below(capacity + 1)) })
                    .map(|(shift, len)| ((first + shift) % capacity, len, shift))
                    .collect();
                let bits = run(kernel, &f32, &f16, &q[1..], &seen).concat();
                results.add(format_args!("{head_dim}, {seen:?} of {capacity}"), bits);
            }
        }
    }
}

#[test]
fn a_batch_has_the_bits_of_its_rows() {
    let mut random = Random(72);
    let (dim, capacity) = (64, 2 * CHUNK + 9);
    let (k, v) = (random.floats(capacity * dim, 1.0), random.floats(capacity * dim, 1.0));
    let (k16, v16): (Vec<_>, Vec<_>) = k.iter().zip(&v).map(|(&k, &v)| (f16::from_f32(k), f16::from_f32(v))).unzip();
    let f32 = Head { k: &k, v: &v, dim, capacity };
    let f16 = Head { k: &k16, v: &v16, dim, capacity };
    let q = random.floats(MAX_BATCH * dim, 1.0);
    let seen = [(capacity - 3, 90, 0), (capacity - 2, 90, 1), (1, CHUNK, 4), (1, CHUNK + 3, 4), (0, 2 * CHUNK, 3)];
    for kernel in Kernel::<Attend>::all() {
        let whole = run(kernel, &f32, &f16, &q, &seen);
        for (r, q) in q.chunks_exact(dim).enumerate() {
            let alone = run(kernel, &f32, &f16, q, &seen[r..=r]);
            for (whole, alone) in whole.iter().zip(&alone) {
                assert!(whole[1 + r * dim..][..dim] == alone[1..], "{} row {r}", kernel.level());
            }
        }
    }
}

#[test]
fn one_token_is_copied_and_equal_scores_average() {
    for kernel in Kernel::<Attend>::all() {
        let k = [0.0f32; 6];
        let v = [1.0f32, 2.0, 3.0, 4.0, 8.0, 9.0];
        let head = Head { k: &k, v: &v, dim: 2, capacity: 3 };
        let result = |len| {
            let mut y = [0.0; 2];
            kernel.run(HeadOf::F32(head), &mut [Row { q: &[3.0, 4.0], y: &mut y, first: 2, len, shift: 0 }]);
            y
        };
        assert_eq!(result(1), [8.0, 9.0], "{}", kernel.level());
        assert_eq!(result(2), [4.5, 5.5], "{}", kernel.level());
    }
}

#[test]
fn a_nan_in_the_cache_shows_where_it_is_seen_alone() {
    for kernel in Kernel::<Attend>::all() {
        for dim in [1, 16] {
            let k = [vec![f32::NAN; dim], vec![1.0; 2 * dim]].concat();
            let v = vec![1.0f32; 3 * dim];
            let head = Head { k: &k, v: &v, dim, capacity: 3 };
            let (q, mut y) = (vec![1.0; dim], [vec![0.0; dim], vec![0.0; dim]]);
            let [a, b] = &mut y;
            let rows = [(a, 3, 0), (b, 2, 0)];
            let mut rows = rows.map(|(y, len, shift)| Row { q: &q, y, first: 1, len, shift });
            kernel.run(HeadOf::F32(head), &mut rows);
            assert!(y[0][0].is_nan() && y[1][0] == 1.0, "{}", kernel.level());
        }
    }
}
