use super::{BASE, SplitRows};
use crate::kernels::operation::Kernel;
use crate::kernels::quantize_rows::GROUP;
use crate::kernels::testing::{Random, Results, for_rows_of_all_sizes};

type Rows = (u32, [Vec<i8>; 2], [Vec<i32>; 2]);

fn run(kernel: Kernel<SplitRows>, x: &[f32]) -> Rows {
    let padded = x.len().next_multiple_of(GROUP);
    let (mut q, mut sums) = ([(); 2].map(|()| vec![99; padded]), [(); 2].map(|()| vec![99; padded / GROUP]));
    let (rows, groups) = (q.each_mut().map(Vec::as_mut_slice), sums.each_mut().map(Vec::as_mut_slice));
    let scale = kernel.run(x, rows, groups);
    (if scale.is_nan() { u32::MAX } else { scale.to_bits() }, q, sums)
}

/// The integer that both rows make of value `i`.
fn joined(q: &[Vec<i8>; 2], i: usize) -> i32 {
    BASE as i32 * i32::from(q[0][i]) + i32::from(q[1][i])
}

pub(super) fn cases(kernel: Kernel<SplitRows>, results: &mut Results) {
    for_rows_of_all_sizes(53, |x, size| {
        let (scale, q, sums) = run(kernel, x);
        let (q, sums) = (q.into_iter().flatten().map(i32::from), sums.into_iter().flatten());
        let bits = std::iter::once(scale).chain(q.chain(sums).map(|v| v as u32));
        results.add(format_args!("{} of {size}", x.len()), bits);
    });
}

#[test]
fn values_come_back_within_half_a_step() {
    let mut random = Random(54);
    for kernel in Kernel::all() {
        let x = random.floats(100, 5.0);
        let (scale, q, sums) = run(kernel, &x);
        let scale = f32::from_bits(scale);
        for (i, x) in x.iter().enumerate() {
            // A float keeps 24 bits of the 16 that are asked for: the rest is the test's own
            // rounding.
            let back = joined(&q, i) as f32 * scale;
            assert!((x - back).abs() <= 0.51 * scale, "{}: {x} as {back} in steps of {scale}", kernel.level());
        }
        assert_eq!(
            (0..100).map(|i| joined(&q, i).abs()).max(),
            Some(254 * 127),
            "the largest value uses the whole range"
        );
        for (q, sums) in q.iter().zip(&sums) {
            assert!(q.iter().all(|&q| q >= -127), "the products take nothing below -127");
            assert_eq!(sums.iter().sum::<i32>(), q.iter().map(|&q| i32::from(q)).sum::<i32>());
            assert!(q[100..].iter().all(|&q| q == 0), "padding is zero");
        }
    }
}

#[test]
fn every_integer_comes_back() {
    let x: Vec<f32> = (-32258..=32258).map(|v| v as f32).collect();
    for kernel in Kernel::all() {
        let (scale, q, _) = run(kernel, &x);
        assert_eq!(f32::from_bits(scale), 1.0, "{}", kernel.level());
        assert!((0..x.len()).all(|i| joined(&q, i) == i as i32 - 32258), "{}", kernel.level());
    }
}
