use super::{Finish, Sums, VARIANTS};
use crate::kernels::math;
use crate::kernels::testing::{Random, available, bits};

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(61);
    for n in 0..=64 {
        let float = random.awkward(n + 1);
        let ints: Vec<i32> = (0..=n).map(|_| random.bits() as i32).collect();
        let (bias, gate, scale) = (random.floats(n + 1, 3.0), random.awkward(n + 1), random.awkward(n + 1));
        let (more_float, more_ints) = (random.awkward(n + 1), ints.iter().rev().copied().collect::<Vec<_>>());
        for sums in [
            Sums::F32(&float[1..]),
            Sums::Scaled(&float[1..], 0.3),
            Sums::I32(&ints[1..], 1e-9, &scale[1..]),
            Sums::ScaledPair([&float[1..], &more_float[1..]], 0.3),
            Sums::I32Pair([&ints[1..], &more_ints[1..]], 1e-9, &scale[1..]),
        ] {
            for finish in [Finish::Store, Finish::Gelu, Finish::Add, Finish::GatedAdd(&gate[1..])] {
                let y0 = random.floats(n + 1, 1.0);
                let mut want = y0.clone();
                // SAFETY: the scalar variant runs anywhere.
                unsafe { (VARIANTS[0].run)(sums, &bias[1..], finish, &mut want[1..]) };
                for v in available(VARIANTS) {
                    let mut y = y0.clone();
                    // SAFETY: `available` yields only what this CPU can run.
                    unsafe { (v.run)(sums, &bias[1..], finish, &mut y[1..]) };
                    assert_eq!(bits(&y), bits(&want), "{} {n}", v.name);
                }
            }
        }
    }
}

#[test]
fn the_four_finishes() {
    for v in available(VARIANTS) {
        for (finish, want) in [
            (Finish::Store, 7.0),
            (Finish::Gelu, math::gelu(7.0)),
            (Finish::Add, 107.0),
            (Finish::GatedAdd(&[0.5]), 103.5),
        ] {
            let mut y = [100.0];
            // SAFETY: `available` yields only what this CPU can run.
            unsafe { (v.run)(Sums::I32(&[8], 0.25, &[2.0]), &[3.0], finish, &mut y) };
            assert_eq!(y, [want], "{}", v.name);
        }
    }
}

#[test]
fn split_rows_are_put_together() {
    for v in available(VARIANTS) {
        let pairs = [Sums::I32Pair([&[2], &[-4]], 0.25, &[2.0]), Sums::ScaledPair([&[2.0], &[-4.0]], 0.5)];
        for sums in pairs {
            let mut y = [0.0];
            // SAFETY: `available` yields only what this CPU can run.
            unsafe { (v.run)(sums, &[3.0], Finish::Store, &mut y) };
            assert_eq!(y, [(2.0 * 254.0 - 4.0) * 0.5 + 3.0], "{}", v.name);
        }
    }
}
