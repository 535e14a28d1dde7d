//! The reference: plain sums; any order gives the same integers.

use super::{Job, NR, Tile};

pub(super) fn run(job: &Job<'_>, tile: &mut Tile<i32>) {
    job.check();
    let padded = job.geo.padded;
    for r in 0..job.x.rows {
        let q = &job.x.q[r * job.x.stride..][..padded];
        for p in 0..job.panels.count {
            let w = &job.weights[(job.panels.first + p) * job.geo.panel..][..NR * padded];
            let mut acc = [0i32; NR];
            for (q, line) in q.as_chunks::<4>().0.iter().zip(w.as_chunks::<64>().0) {
                for (acc, w) in acc.iter_mut().zip(line.as_chunks::<4>().0) {
                    *acc += q.iter().zip(w).map(|(&q, &w)| i32::from(q) * i32::from(w as i8)).sum::<i32>();
                }
            }
            tile[r][p * NR..][..NR].copy_from_slice(&acc);
        }
    }
}
