use super::{Activate, Activation};
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

pub(super) fn cases(kernel: Kernel<Activate>, results: &mut Results) {
    let mut random = Random(21);
    for n in (0..70).chain([1000]) {
        for scale in [1.0, 30.0] {
            let mut x = random.awkward(n + 1);
            x.iter_mut().for_each(|v| *v *= scale);
            for activation in [Activation::Gelu, Activation::Silu] {
                let mut y = x.clone();
                kernel.run(activation, &mut y[1..]);
                results.add(format_args!("{activation:?} {n}"), bits(&y));
            }
        }
    }
}

#[test]
fn known_values_and_extremes() {
    for kernel in Kernel::<Activate>::all() {
        let level = kernel.level();
        let mut x = [0.0, 1.0, -1.0, 3.0, 1e30, -1e30, f32::NAN];
        let mut y = x;
        kernel.run(Activation::Gelu, &mut x);
        kernel.run(Activation::Silu, &mut y);
        let near = |a: f32, b: f32| (a - b).abs() < 1e-6;
        assert!(near(x[1], 0.841_192) && near(x[2], -0.158_808) && near(x[3], 2.996_363), "{level}: {x:?}");
        assert!(near(y[1], 0.731_058_6) && near(y[2], -0.268_941_4) && near(y[3], 2.857_722_5), "{level}: {y:?}");
        assert!(x[0] == 0.0 && x[4] == 1e30 && x[5].abs() < 1e-7 && x[6].is_nan(), "{level}: {x:?}");
        assert!(y[0] == 0.0 && y[4] == 1e30 && y[5].abs() < 1e-7 && y[6].is_nan(), "{level}: {y:?}");
    }
}
