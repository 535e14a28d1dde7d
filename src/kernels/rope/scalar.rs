//! The reference: head by head.

#[inline(always)]
pub(super) fn run(x: &mut [f32], cos: &[f32], sin: &[f32]) {
    let half = cos.len();
    assert!(half > 0 && sin.len() == half && x.len().is_multiple_of(2 * half), "rope: whole heads");
    for head in x.chunks_exact_mut(2 * half) {
        let (a, b) = head.split_at_mut(half);
        for (((a, b), c), s) in a.iter_mut().zip(b).zip(cos).zip(sin) {
            let (u, v) = (*a, *b);
            *a = u.mul_add(*c, -(v * s));
            *b = v.mul_add(*c, u * s);
        }
    }
}
