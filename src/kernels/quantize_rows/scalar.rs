//! The reference: the largest magnitude, then the row, then the sums of its groups.

use super::GROUP;

/// Below this a row counts as zero: 127 / max|x| would overflow.
pub(super) const TINY: f32 = 1e-30;

/// Rounds to nearest even: the low byte of x + MAGIC is the integer, for |x| < 2^22.
pub(in crate::kernels) const MAGIC: f32 = 12_582_912.0;

/// The largest magnitude. They are compared as integers: exact, and a NaN is larger than
/// everything.
#[inline(always)]
pub(in crate::kernels) fn largest(x: &[f32]) -> f32 {
    let mut top = [0u32; 16];
    let (head, tail) = x.as_chunks::<16>();
    for chunk in head {
        for (t, v) in top.iter_mut().zip(chunk) {
            *t = (*t).max(v.to_bits() & 0x7fff_ffff);
        }
    }
    for (t, v) in top.iter_mut().zip(tail) {
        *t = (*t).max(v.to_bits() & 0x7fff_ffff);
    }
    f32::from_bits(top.into_iter().fold(0, u32::max))
}

/// A largest magnitude that a row can be scaled by; else the scale of the row of zeros that stands
/// for it.
#[inline(always)]
pub(in crate::kernels) fn scalable(top: f32) -> Result<f32, f32> {
    match top {
        t if (TINY..f32::INFINITY).contains(&t) => Ok(t),
        t if t < TINY => Err(0.0),
        _ => Err(f32::NAN),
    }
}

#[inline(always)]
pub(super) fn run(x: &[f32], q: &mut [i8], sums: &mut [i32]) -> f32 {
    assert!(q.len() >= x.len() && q.len() == sums.len() * GROUP, "q is padded to whole groups");
    let top = match scalable(largest(x)) {
        Ok(top) => top,
        Err(scale) => {
            q.fill(0);
            sums.fill(0);
            return scale;
        }
    };
    let inverse = 127.0 / top;
    for (q, x) in q.iter_mut().zip(x) {
        *q = (x * inverse + MAGIC).to_bits() as u8 as i8;
    }
    q[x.len()..].fill(0);
    for (sum, group) in sums.iter_mut().zip(q.as_chunks::<GROUP>().0) {
        *sum = group.iter().map(|&v| i32::from(v)).sum();
    }
    top / 127.0
}
