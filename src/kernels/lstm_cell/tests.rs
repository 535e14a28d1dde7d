use super::LstmCell;
use crate::kernels::operation::Kernel;
use crate::kernels::testing::{Random, Results, bits};

pub(super) fn cases(kernel: Kernel<LstmCell>, results: &mut Results) {
    let mut random = Random(84);
    for n in (0..70).chain([500]) {
        let gates = random.awkward(4 * n);
        let (mut c, mut h) = (random.floats(n + 1, 2.0), vec![0.0; n + 1]);
        for step in 0..3 {
            kernel.run(&gates, &mut c[1..], &mut h[1..]);
            results.add(format_args!("{n}, step {step}"), bits(&c).into_iter().chain(bits(&h)));
        }
    }
}

#[test]
fn equals_f64() {
    let mut random = Random(85);
    let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
    for kernel in Kernel::<LstmCell>::all() {
        let (gates, before) = (random.floats(4 * 32, 6.0), random.floats(32, 2.0));
        let (mut c, mut h) = (before.clone(), vec![0.0; 32]);
        kernel.run(&gates, &mut c, &mut h);
        for k in 0..32 {
            let [i, f, g, o] = [0, 1, 2, 3].map(|gate| f64::from(gates[gate * 32 + k]));
            let cell = sigmoid(f) * f64::from(before[k]) + sigmoid(i) * g.tanh();
            assert!((f64::from(c[k]) - cell).abs() < 1e-6, "{} {cell}", c[k]);
            assert!((f64::from(h[k]) - sigmoid(o) * cell.tanh()).abs() < 1e-6, "{}", h[k]);
        }
    }
}
