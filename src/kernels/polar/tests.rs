use super::Polar;
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

type M = [f32; 9];

fn run(kernel: Kernel<Polar>, m: &[M]) -> Vec<M> {
    let mut out = vec![[0.0; 9]; m.len()];
    kernel.run(m, &mut out);
    out
}

fn mul(a: &M, b: &M) -> M {
    std::array::from_fn(|i| (0..3).map(|k| a[i / 3 * 3 + k] * b[k * 3 + i % 3]).sum())
}

fn transposed(a: &M) -> M {
    std::array::from_fn(|i| a[i % 3 * 3 + i / 3])
}

fn det(a: &M) -> f32 {
    a[0] * (a[4] * a[8] - a[5] * a[7]) - a[1] * (a[3] * a[8] - a[5] * a[6]) + a[2] * (a[3] * a[7] - a[4] * a[6])
}

fn rotation(random: &mut Random) -> M {
    let q: [f32; 4] = std::array::from_fn(|_| random.unit());
    let n = q.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-3);
    let [w, x, y, z] = q.map(|v| v / n);
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
}

fn assert_rotation(r: &M) {
    let id = mul(&transposed(r), r);
    for (i, v) in id.iter().enumerate() {
        assert!((v - f32::from(i % 4 == 0)).abs() < 2e-6, "not orthogonal: {r:?}");
    }
    assert!((det(r) - 1.0).abs() < 3e-6, "determinant of {r:?}");
}

pub(super) fn cases(kernel: Kernel<Polar>, results: &mut Results) {
    let mut random = Random(11);
    for n in (0..50).chain([127 * 4]) {
        let m: Vec<M> = (0..n).map(|_| std::array::from_fn(|_| random.unit() * 10.0)).collect();
        results.add(n, bits(run(kernel, &m).as_flattened()));
    }
}

#[test]
fn stretched_and_noisy_rotations_come_back() {
    let mut random = Random(12);
    for size in [1e-20f32, 0.1, 1.0, 1e15] {
        let mut m = Vec::new();
        let mut want = Vec::new();
        for _ in 0..200 {
            let (r, s) = (rotation(&mut random), rotation(&mut random));
            // R times a symmetric positive matrix has polar factor R.
            let stretch = [0.2 + random.unit().abs(), 1.0, 3.0 * random.unit().abs() + 0.1];
            let scaled: M = std::array::from_fn(|i| s[i] * stretch[i / 3]);
            let spd = mul(&transposed(&s), &scaled);
            m.push(mul(&r, &spd).map(|v| v * size));
            want.push(r);
        }
        for kernel in Kernel::all() {
            for (got, want) in run(kernel, &m).iter().zip(&want) {
                assert_rotation(got);
                assert!(
                    got.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-5),
                    "{}: {got:?} for {want:?}",
                    kernel.level()
                );
            }
        }
    }
}

#[test]
fn reflections_get_the_best_rotation() {
    let mut random = Random(13);
    for _ in 0..100 {
        let m: M = std::array::from_fn(|_| random.unit());
        for kernel in Kernel::all() {
            let got = run(kernel, &[m])[0];
            assert_rotation(&got);
            let trace = |r: &M| r.iter().zip(&m).map(|(a, b)| a * b).sum::<f32>();
            for _ in 0..50 {
                let other = rotation(&mut random);
                assert!(trace(&other) <= trace(&got) + 1e-4, "{}: {other:?} beats {got:?} for {m:?}", kernel.level());
            }
        }
    }
}

#[test]
fn degenerate_and_broken_matrices_give_rotations() {
    let mut cases = vec![[0.0f32; 9], [f32::NAN; 9], [1.0; 9], [1e-45; 9], [f32::MAX; 9]];
    cases.push([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    cases.push([-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0]);
    cases.push([-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]);
    cases.push([f32::INFINITY, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    for kernel in Kernel::all() {
        for (m, r) in cases.iter().zip(run(kernel, &cases)) {
            assert!(r.iter().all(|v| v.is_finite()), "{}: {r:?} for {m:?}", kernel.level());
            assert_rotation(&r);
        }
        assert_eq!(run(kernel, &[[f32::NAN; 9]])[0], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    }
}
