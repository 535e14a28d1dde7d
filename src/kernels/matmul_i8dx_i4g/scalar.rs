//! The reference: exact sums of each group, groups in ascending order.

use super::{GROUP, GROUP_BYTES, Geometry, Job, NR, Tile};

pub(super) fn run(job: &Job<'_>, tile: &mut Tile<f32>) {
    job.check();
    let padded = job.geo.padded();
    for r in 0..job.x.rows {
        let q = &job.x.q[r * job.x.stride..][..padded];
        for p in 0..job.panels.count {
            let start = (job.panels.first + p) * job.geo.panel;
            let weights = &job.weights[start..][..job.geo.panel];
            let scales = &job.scales[start / 2..][..job.geo.panel / 2];
            let mut sum = [0.0f32; NR];
            for (g, q) in q.as_chunks::<GROUP>().0.iter().enumerate() {
                let nibbles = &weights[Geometry::nibbles(g)..][..GROUP_BYTES];
                let scales = &scales[Geometry::scales(g)..][..NR];
                for l in 0..NR {
                    let mut acc = 0i32;
                    for (j, q) in q.as_chunks::<8>().0.iter().enumerate() {
                        for (i, &byte) in nibbles[j * 64 + l * 4..][..4].iter().enumerate() {
                            acc += i32::from(q[i]) * (i32::from(byte & 15) - 8);
                            acc += i32::from(q[4 + i]) * (i32::from(byte >> 4) - 8);
                        }
                    }
                    sum[l] = scales[l].to_f32_const().mul_add(acc as f32, sum[l]);
                }
            }
            tile[r][p * NR..][..NR].copy_from_slice(&sum);
        }
    }
}
