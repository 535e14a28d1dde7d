//! The reference, for any weight type: 16 outputs in lanes, column by column of all segments.

use super::{FloatGeometry, Job, Tile};
use crate::kernels::f32x16::Stored;
use crate::kernels::packed::{NR, SEGMENTS};

pub(crate) fn run<W: Stored>(job: &Job<'_, W>, tile: &mut Tile<f32>) {
    job.check();
    let FloatGeometry { seg, seg_stride, panel } = job.geo;
    for r in 0..job.rows {
        let x = &job.x[r * job.stride..][..job.geo.padded()];
        for p in 0..job.panels.count {
            let w = &job.weights[(job.panels.first + p) * panel..][..panel];
            let mut acc = [0.0f32; NR];
            for k in 0..seg {
                for s in 0..SEGMENTS {
                    let (x, w) = (x[s * seg + k], &w[s * seg_stride + k * NR..][..NR]);
                    for l in 0..NR {
                        acc[l] = x.mul_add(w[l].to_f32(), acc[l]);
                    }
                }
            }
            tile[r][p * NR..][..NR].copy_from_slice(&acc);
        }
    }
}
