use super::VARIANTS;
use crate::kernels::testing::{Random, available, bits};

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(41);
    for half in (1..40).chain([128]) {
        for heads in 0..4 {
            let x = random.awkward(heads * 2 * half + 1);
            let (cos, sin) = (random.floats(half, 1.0), random.floats(half, 1.0));
            let mut want = x.clone();
            // SAFETY: the scalar variant runs anywhere.
            unsafe { (VARIANTS[0].run)(&mut want[1..], &cos, &sin) };
            for v in available(VARIANTS) {
                let mut y = x.clone();
                // SAFETY: `available` yields only what this CPU can run.
                unsafe { (v.run)(&mut y[1..], &cos, &sin) };
                assert_eq!(bits(&y), bits(&want), "{} {half} x {heads}", v.name);
            }
        }
    }
}

#[test]
fn a_quarter_turn_swaps_the_halves() {
    for v in available(VARIANTS) {
        let mut x = [1.0, 2.0, 3.0, 4.0];
        // SAFETY: `available` yields only what this CPU can run.
        unsafe { (v.run)(&mut x, &[0.0, 0.0], &[1.0, 1.0]) };
        assert_eq!(x, [-3.0, -4.0, 1.0, 2.0], "{}", v.name);
    }
}
