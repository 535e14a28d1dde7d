use half::f16;

use super::{CHUNK, Head, VARIANTS};
use crate::kernels::testing::{Random, available, bits};

#[test]
fn variants_have_the_bits_of_the_reference() {
    let mut random = Random(71);
    for head_dim in (1..40).chain([64, 80, 128, 256, 100]) {
        let (capacity, offset) = (1 + random.below(3 * CHUNK), random.below(4));
        let k = random.floats(capacity * head_dim + offset, 2.0);
        let v =
            random.awkward(capacity * head_dim + offset).into_iter().map(|v| v.clamp(-1e3, 1e3)).collect::<Vec<_>>();
        let half = |v: &[f32]| v.iter().map(|&v| f16::from_f32(v)).collect::<Vec<_>>();
        let (k16, v16) = (half(&k), half(&v));
        for len in [0, 1, capacity / 2, capacity] {
            for scale in [1.0, 1e4] {
                let q = random.floats(head_dim + 1, scale);
                let slot = random.below(capacity);
                let f32 = Head { k: &k[offset..], v: &v[offset..], dim: head_dim, capacity, slot, len };
                let f16 = Head { k: &k16[offset..], v: &v16[offset..], dim: head_dim, capacity, slot, len };
                let run = |variant: &crate::kernels::Variant<super::Kernel>| {
                    let (mut a, mut b) = (vec![5.0; head_dim + 1], vec![5.0; head_dim + 1]);
                    // SAFETY: `available` yields only what this CPU can run.
                    unsafe {
                        (variant.run.f32)(&f32, &q[1..], &mut a[1..]);
                        (variant.run.f16)(&f16, &q[1..], &mut b[1..]);
                    }
                    (bits(&a), bits(&b))
                };
                let want = run(&VARIANTS[0]);
                for variant in available(VARIANTS) {
                    assert!(run(variant) == want, "{} {head_dim} {len} of {capacity}", variant.name);
                }
            }
        }
    }
}

#[test]
fn one_token_is_copied_and_equal_scores_average() {
    for variant in available(VARIANTS) {
        let k = [0.0f32; 6];
        let v = [1.0f32, 2.0, 3.0, 4.0, 8.0, 9.0];
        let mut y = [0.0; 2];
        let mut head = Head { k: &k, v: &v, dim: 2, capacity: 3, slot: 2, len: 1 };
        // SAFETY: `available` yields only what this CPU can run.
        unsafe { (variant.run.f32)(&head, &[3.0, 4.0], &mut y) };
        assert_eq!(y, [8.0, 9.0], "{}", variant.name);
        head.len = 2;
        // SAFETY: as above.
        unsafe { (variant.run.f32)(&head, &[3.0, 4.0], &mut y) };
        assert_eq!(y, [4.5, 5.5], "{}", variant.name);
    }
}

#[test]
fn a_nan_in_the_cache_shows() {
    for variant in available(VARIANTS) {
        let (k, v) = ([f32::NAN, 1.0, 1.0], [1.0f32, 1.0, 1.0]);
        let head = Head { k: &k, v: &v, dim: 1, capacity: 3, slot: 1, len: 3 };
        let mut y = [0.0];
        // SAFETY: `available` yields only what this CPU can run.
        unsafe { (variant.run.f32)(&head, &[1.0], &mut y) };
        assert!(y[0].is_nan(), "{}", variant.name);
    }
}
