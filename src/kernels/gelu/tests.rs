use super::VARIANTS;
use crate::kernels::testing::{Random, available, bits};

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(21);
    for n in (0..70).chain([1000]) {
        for scale in [1.0, 30.0] {
            let mut x = random.awkward(n + 1);
            x.iter_mut().for_each(|v| *v *= scale);
            let (mut gelu, mut silu) = (x.clone(), x.clone());
            // SAFETY: the scalar variant runs anywhere; `available` yields only what this CPU can run.
            unsafe {
                (VARIANTS[0].run.gelu)(&mut gelu[1..]);
                (VARIANTS[0].run.silu)(&mut silu[1..]);
                for v in available(VARIANTS) {
                    let (mut a, mut b) = (x.clone(), x.clone());
                    (v.run.gelu)(&mut a[1..]);
                    (v.run.silu)(&mut b[1..]);
                    assert_eq!((bits(&a), bits(&b)), (bits(&gelu), bits(&silu)), "{} {n}", v.name);
                }
            }
        }
    }
}

#[test]
fn known_values_and_extremes() {
    for v in available(VARIANTS) {
        let mut x = [0.0, 1.0, -1.0, 3.0, 1e30, -1e30, f32::NAN];
        let mut y = x;
        // SAFETY: `available` yields only what this CPU can run.
        unsafe {
            (v.run.gelu)(&mut x);
            (v.run.silu)(&mut y);
        }
        let near = |a: f32, b: f32| (a - b).abs() < 1e-6;
        assert!(near(x[1], 0.841_192) && near(x[2], -0.158_808) && near(x[3], 2.996_363), "{}: {x:?}", v.name);
        assert!(near(y[1], 0.731_058_6) && near(y[2], -0.268_941_4) && near(y[3], 2.857_722_5), "{}: {y:?}", v.name);
        assert!(x[0] == 0.0 && x[4] == 1e30 && x[5].abs() < 1e-7 && x[6].is_nan(), "{}: {x:?}", v.name);
        assert!(y[0] == 0.0 && y[4] == 1e30 && y[5].abs() < 1e-7 && y[6].is_nan(), "{}: {y:?}", v.name);
    }
}
