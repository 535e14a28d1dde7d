use super::{Finish, FinishRow, RowSums, Sums};
use crate::kernels::math;
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

pub(super) fn cases(kernel: Kernel<FinishRow>, results: &mut Results) {
    let mut random = Random(61);
    for n in 0..=64 {
        let float = random.awkward(n + 1);
        let ints: Vec<i32> = (0..=n).map(|_| random.bits() as i32).collect();
        let (bias, gate, scale) = (random.floats(n + 1, 3.0), random.awkward(n + 1), random.awkward(n + 1));
        let (more_float, more_ints) = (random.awkward(n + 1), ints.iter().rev().copied().collect::<Vec<_>>());
        for (i, sums) in [
            Sums::F32(RowSums::Whole(&float[1..]), 1.0),
            Sums::F32(RowSums::Whole(&float[1..]), 0.3),
            Sums::I32(RowSums::Whole(&ints[1..]), 1e-9, &scale[1..]),
            Sums::F32(RowSums::Split([&float[1..], &more_float[1..]]), 0.3),
            Sums::I32(RowSums::Split([&ints[1..], &more_ints[1..]]), 1e-9, &scale[1..]),
        ]
        .into_iter()
        .enumerate()
        {
            for finish in [Finish::Store, Finish::Gelu, Finish::Add, Finish::GatedAdd(&gate[1..])] {
                let mut y = random.floats(n + 1, 1.0);
                kernel.run(sums, &bias[1..], finish, &mut y[1..]);
                results.add(format_args!("{n}, sums {i}"), bits(&y));
            }
        }
    }
}

#[test]
fn the_four_finishes() {
    for kernel in Kernel::<FinishRow>::all() {
        for (finish, want) in [
            (Finish::Store, 7.0),
            (Finish::Gelu, math::gelu(7.0)),
            (Finish::Add, 107.0),
            (Finish::GatedAdd(&[0.5]), 103.5),
        ] {
            let mut y = [100.0];
            kernel.run(Sums::I32(RowSums::Whole(&[8]), 0.25, &[2.0]), &[3.0], finish, &mut y);
            assert_eq!(y, [want], "{}", kernel.level());
        }
    }
}

#[test]
fn split_rows_are_put_together() {
    for kernel in Kernel::<FinishRow>::all() {
        let pairs =
            [Sums::I32(RowSums::Split([&[2], &[-4]]), 0.25, &[2.0]), Sums::F32(RowSums::Split([&[2.0], &[-4.0]]), 0.5)];
        for sums in pairs {
            let mut y = [0.0];
            kernel.run(sums, &[3.0], Finish::Store, &mut y);
            assert_eq!(y, [(2.0 * 254.0 - 4.0) * 0.5 + 3.0], "{}", kernel.level());
        }
    }
}
