use super::Rope;
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

pub(super) fn cases(kernel: Kernel<Rope>, results: &mut Results) {
    let mut random = Random(41);
    for half in (1..40).chain([128]) {
        for heads in 0..4 {
            let mut x = random.awkward(heads * 2 * half + 1);
            let (cos, sin) = (random.floats(half, 1.0), random.floats(half, 1.0));
            kernel.run(&mut x[1..], &cos, &sin);
            results.add(format_args!("{half} x {heads}"), bits(&x));
        }
    }
}

#[test]
fn a_quarter_turn_swaps_the_halves() {
    for kernel in Kernel::<Rope>::all() {
        let mut x = [1.0, 2.0, 3.0, 4.0];
        kernel.run(&mut x, &[0.0, 0.0], &[1.0, 1.0]);
        assert_eq!(x, [-3.0, -4.0, 1.0, 2.0], "{}", kernel.level());
    }
}
