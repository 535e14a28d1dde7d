//! The reference: the largest magnitude, then both rows, then the sums of their groups.

use super::BASE;
use crate::kernels::quantize_rows::{GROUP, MAGIC, largest, scalable};

/// Largest magnitude of high and low, and of the integer that they make.
const TOP: f32 = 127.0;
pub(super) const RANGE: f32 = BASE * TOP;

#[inline(always)]
pub(super) fn run(x: &[f32], [high, low]: [&mut [i8]; 2], [high_sums, low_sums]: [&mut [i32]; 2]) -> f32 {
    let padded = high.len();
    assert!(padded >= x.len() && low.len() == padded, "both rows are padded");
    assert!(padded == high_sums.len() * GROUP && padded == low_sums.len() * GROUP, "q is padded to whole groups");
    let top = match scalable(largest(x)) {
        Ok(top) => top,
        Err(scale) => {
            [high, low].into_iter().for_each(|q| q.fill(0));
            [high_sums, low_sums].into_iter().for_each(|sums| sums.fill(0));
            return scale;
        }
    };
    let inverse = RANGE / top;
    for ((high, low), x) in high.iter_mut().zip(&mut *low).zip(x) {
        // Adding MAGIC rounds to an integer, and all that follows is exact: |q| < 2^22. q / 254 is
        // off by less than a part in 2^23, so that at worst a half goes to the other side, where
        // low is 127 instead of -127.
        let q = (x * inverse + MAGIC) - MAGIC;
        let h = q * (1.0 / BASE) + MAGIC;
        *high = h.to_bits() as u8 as i8;
        *low = (q - (h - MAGIC) * BASE + MAGIC).to_bits() as u8 as i8;
    }
    for (q, sums) in [(high, high_sums), (low, low_sums)] {
        q[x.len()..].fill(0);
        for (sum, group) in sums.iter_mut().zip(q.as_chunks::<GROUP>().0) {
            *sum = group.iter().map(|&v| i32::from(v)).sum();
        }
    }
    top / RANGE
}
