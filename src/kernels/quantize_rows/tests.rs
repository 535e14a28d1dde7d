use super::{GROUP, QuantizeRows};
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, for_rows_of_all_sizes};

fn run(kernel: Kernel<QuantizeRows>, x: &[f32]) -> (u32, Vec<i8>, Vec<i32>) {
    let padded = x.len().next_multiple_of(GROUP);
    let (mut q, mut sums) = (vec![99; padded], vec![99; padded / GROUP]);
    let scale = kernel.run(x, &mut q, &mut sums);
    (if scale.is_nan() { u32::MAX } else { scale.to_bits() }, q, sums)
}

pub(super) fn cases(kernel: Kernel<QuantizeRows>, results: &mut Results) {
    for_rows_of_all_sizes(51, |x, size| {
        let (scale, q, sums) = run(kernel, x);
        let bits = std::iter::once(scale).chain(q.into_iter().map(i32::from).chain(sums).map(|v| v as u32));
        results.add(format_args!("{} of {size}", x.len()), bits);
    });
}

#[test]
fn values_come_back_within_half_a_step() {
    let mut random = Random(52);
    for kernel in Kernel::all() {
        let x = random.floats(100, 5.0);
        let (scale, q, sums) = run(kernel, &x);
        let scale = f32::from_bits(scale);
        for (x, &q) in x.iter().zip(&q) {
            assert!((x - f32::from(q) * scale).abs() <= 0.50001 * scale, "{}: {x} as {q} * {scale}", kernel.level());
        }
        assert_eq!(q.iter().map(|&q| i32::from(q).abs()).max(), Some(127), "the largest value uses the whole range");
        assert_eq!(sums.iter().sum::<i32>(), q.iter().map(|&q| i32::from(q)).sum::<i32>());
        assert!(q[100..].iter().all(|&q| q == 0), "padding is zero");
    }
}

#[test]
fn halves_round_to_even() {
    for kernel in Kernel::all() {
        let (_, q, _) = run(kernel, &[127.0, 0.5, 1.5, 2.5, -0.5, -1.5, -127.0]);
        assert_eq!(q[..7], [127, 0, 2, 2, 0, -2, -127], "{}", kernel.level());
    }
}
