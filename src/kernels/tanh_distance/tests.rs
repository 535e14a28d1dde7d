use super::TanhDistance;
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

pub(super) fn cases(kernel: Kernel<TanhDistance>, results: &mut Results) {
    let mut random = Random(83);
    for n in (0..70).chain([1000]) {
        let (a, b) = (random.awkward(n + 1), random.awkward(n + 1));
        let mut y = vec![0.0; n + 1];
        kernel.run(&a[1..], &b[1..], &mut y[1..]);
        results.add(n, bits(&y));
    }
}

#[test]
fn known_values() {
    for kernel in Kernel::<TanhDistance>::all() {
        let mut y = [9.0; 5];
        kernel.run(&[1.0, 0.5, -3.0, 1e30, f32::NAN], &[1.0, 0.0, 3.0, -1e30, 0.0], &mut y);
        assert!(y[0] == 0.0 && (y[1] - 0.462_117_16).abs() < 2e-7 && (y[2] - 0.999_987_7).abs() < 2e-7, "{y:?}");
        assert!(y[3] == 1.0 && y[4].is_nan(), "{y:?}");
    }
}
