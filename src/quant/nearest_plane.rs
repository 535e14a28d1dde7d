//! Rounding by activation statistics: each weight makes up for the errors of those rounded before
//! it, as far as the layer's inputs go together.
//!
//! The error of a row of outputs is (w - q)' H (w - q) with H the second moments of the inputs.
//! With H = R'R, R upper triangular, it is the squared length of R (w - q), and rounding from the
//! last column to the first makes each of its components as small as the grid allows (Babai's
//! nearest plane, 1986; GPTQ of Frantar et al. 2022 does the same in another order).

use super::round::{int4_scale, int8_scale, nearest};
use crate::bundle::{StoredData, StoredWeights};
use crate::error::Result;
use crate::kernels::{I4_GROUP, Scheme};

/// Share of the mean diagonal that is added to the diagonal of H: what has not been seen is taken
/// to be a little of everything.
const DAMPING: f64 = 0.01;

/// R of H + damping = R'R for the second moments `h` (`n x n`, upper triangle read), row-major;
/// `None` where there was no input at all.
pub(super) fn factor(h: &[f64], n: usize) -> Option<Vec<f32>> {
    let damping = DAMPING * (0..n).map(|i| h[i * n + i]).sum::<f64>() / n as f64;
    if !(damping > 0.0 && damping.is_finite()) {
        return None;
    }
    let mut r = h.to_vec();
    for i in 0..n {
        r[i * n + i] += damping;
    }
    for i in 0..n {
        let (done, rest) = r.split_at_mut((i + 1) * n);
        let row = &mut done[i * n..];
        let pivot = row[i].max(0.1 * damping).sqrt();
        row[i..].iter_mut().for_each(|v| *v /= pivot);
        row[i] = pivot;
        for k in i + 1..n {
            let f = row[k];
            let below = &mut rest[(k - i - 1) * n..][k..n];
            below.iter_mut().zip(&row[k..]).for_each(|(b, v)| *b -= f * v);
        }
    }
    Some(r.into_iter().map(|v| v as f32).collect())
}

/// Rounds as [`round`](super::round()) does, but so that the outputs on inputs with factor `r` lose
/// least.
pub(super) fn round_for(w: &[f32], rows: usize, cols: usize, scheme: Scheme, r: &[f32]) -> Result<StoredWeights> {
    let group = if scheme == Scheme::I4 { I4_GROUP } else { cols };
    let (mut i8s, mut i8_scales) = (Vec::new(), Vec::new());
    let (mut i4s, mut i4_scales) = (Vec::new(), Vec::new());
    let (mut target, mut error, mut q) = (vec![0.0f32; cols], vec![0.0f32; cols], vec![0.0f32; cols]);
    for row in w.chunks_exact(cols) {
        error.fill(0.0);
        let mut scales = vec![half::f16::ZERO; cols.div_ceil(group)];
        let mut scale8 = 0.0;
        for (g, start) in (0..cols).step_by(group).enumerate().rev() {
            let end = cols.min(start + group);
            // What later groups leave to be made up for.
            for i in start..end {
                target[i] = row[i] + dot(&r[i * cols..][end..cols], &error[end..]) / r[i * cols + i];
            }
            let (scale, low, high) = if scheme == Scheme::I4 {
                scales[g] = int4_scale(&target[start..end])?;
                (scales[g].to_f32(), -8.0, 7.0)
            } else {
                scale8 = int8_scale(row);
                (scale8, -127.0, 127.0)
            };
            for i in (start..end).rev() {
                let wanted = target[i] + dot(&r[i * cols..][i + 1..end], &error[i + 1..end]) / r[i * cols + i];
                q[i] = nearest(wanted, scale, low, high);
                error[i] = row[i] - scale * q[i];
            }
        }
        if scheme == Scheme::I4 {
            let mut nibbles: Vec<u8> = q.iter().map(|v| (v + 8.0) as u8).collect();
            // Nobody reads the odd nibble at the end; 8 stands for 0.
            nibbles.resize(cols.next_multiple_of(2), 8);
            i4s.extend(nibbles.chunks_exact(2).map(|pair| pair[0] | pair[1] << 4));
            i4_scales.extend(scales);
        } else {
            i8s.extend(q.iter().map(|v| *v as i8));
            i8_scales.push(scale8);
        }
    }
    let data = match scheme {
        Scheme::I4 => StoredData::I4 { q: i4s, scale: i4_scales },
        _ => StoredData::I8 { q: i8s, scale: i8_scales },
    };
    Ok(StoredWeights { rows, cols, data })
}

/// Sum of products in 16 lanes: the same order everywhere.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut acc = [0.0f32; 16];
    let ((a, a_tail), (b, b_tail)) = (a.as_chunks::<16>(), b.as_chunks::<16>());
    for (a, b) in a.iter().zip(b) {
        for l in 0..16 {
            acc[l] += a[l] * b[l];
        }
    }
    let tail: f32 = a_tail.iter().zip(b_tail).map(|(a, b)| a * b).sum();
    acc.iter().sum::<f32>() + tail
}
