use super::Norm;
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

fn run(kernel: Kernel<Norm>, x: &[f32], shift: &[f32], scale: &[f32]) -> Vec<f32> {
    let mut y = vec![0.0; x.len() + 1];
    kernel.run(x, shift, scale, &mut y[1..]);
    y.split_off(1)
}

pub(super) fn cases(kernel: Kernel<Norm>, results: &mut Results) {
    let mut random = Random(31);
    for n in (1..70).chain([256, 1024, 1027]) {
        for spread in [1e-20, 1.0, 1e10] {
            let (x, shift, scale) = (random.floats(n + 1, spread), random.awkward(n), random.awkward(n));
            results.add(format_args!("{n} of {spread}"), bits(&run(kernel, &x[1..], &shift, &scale)));
        }
    }
}

#[test]
fn constant_rows_give_the_shift_and_nan_shows() {
    for kernel in Kernel::all() {
        let level = kernel.level();
        let y = run(kernel, &[7.0; 20], &[0.5; 20], &[3.0; 20]);
        assert_eq!(y, [0.5; 20], "{level}");
        let mut x = [1.0; 20];
        x[17] = f32::NAN;
        assert!(run(kernel, &x, &[0.0; 20], &[1.0; 20]).iter().all(|y| y.is_nan()), "{level}");
    }
}
