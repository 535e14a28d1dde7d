use super::VARIANTS;
use crate::kernels::testing::{Random, available, bits};

fn run(v: &crate::kernels::Variant<super::Run>, x: &[f32], shift: &[f32], scale: &[f32]) -> Vec<f32> {
    let mut y = vec![0.0; x.len() + 1];
    // SAFETY: `available` yields only what this CPU can run.
    unsafe { (v.run)(x, shift, scale, &mut y[1..]) };
    y.split_off(1)
}

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(31);
    for n in (1..70).chain([256, 1024, 1027]) {
        for spread in [1e-20, 1.0, 1e10] {
            let (x, shift, scale) = (random.floats(n + 1, spread), random.awkward(n), random.awkward(n));
            let want = run(&VARIANTS[0], &x[1..], &shift, &scale);
            for v in available(VARIANTS) {
                assert_eq!(bits(&run(v, &x[1..], &shift, &scale)), bits(&want), "{} {n}", v.name);
            }
        }
    }
}

#[test]
fn constant_rows_give_the_shift_and_nan_shows() {
    for v in available(VARIANTS) {
        let y = run(v, &[7.0; 20], &[0.5; 20], &[3.0; 20]);
        assert_eq!(y, [0.5; 20], "{}", v.name);
        let mut x = [1.0; 20];
        x[17] = f32::NAN;
        assert!(run(v, &x, &[0.0; 20], &[1.0; 20]).iter().all(|y| y.is_nan()), "{}", v.name);
    }
}
