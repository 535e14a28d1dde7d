//! Things that networks are run on, shared out whole: each to one thread, which has an [`Exec`] of
//! its own.

use super::Exec;
use crate::error::Result;
use crate::par::Pool;

impl Exec {
    /// The same with scratch for matrices of `width` for each of two threads, if it has two:
    /// [`Exec::each`] shares out what keeps within it.
    ///
    /// # Errors
    /// As [`Exec::new`].
    pub fn with_workers(mut self, width: usize) -> Result<Self> {
        let worker = || Exec::new(self.kernels, 1, width);
        self.workers = if self.threads() == 2 { Some(Box::new([worker()?, worker()?])) } else { None };
        Ok(self)
    }

    /// The pool of threads, for work without kernels' scratch.
    pub fn pool_mut(&mut self) -> &mut Pool {
        &mut self.pool
    }

    /// Calls `work` once for each of `items`: side by side, with an `Exec` of one thread each, or,
    /// where there is one item only or there are no [workers](Exec::with_workers), one after the
    /// other with this one. What comes out has the same bits.
    ///
    /// # Panics
    /// With the panic of one of them.
    pub fn each<T: Send>(&mut self, items: &mut [T], work: impl Fn(&mut Exec, &mut T) + Sync) {
        // Whoever listens to activations listens to this one.
        let alone = items.len() < 2 || self.activations.is_some();
        match if alone { None } else { self.workers.as_deref_mut() } {
            Some(workers) => self.pool.each_with(workers, items, |worker, _, item| work(worker, item)),
            None => items.iter_mut().for_each(|item| work(self, item)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Random, bits, levels};
    use super::super::{Epilogue, WeightData, Weights};
    use super::*;

    #[test]
    fn shared_out_or_not_the_bits_are_the_same() {
        const ROWS: usize = 40;
        let (cols, out) = (70, 100);
        let mut random = Random(5);
        let (q, scale) = (random.bytes(out * cols), vec![0.01; out]);
        let inputs: Vec<_> = (0..9).map(|_| random.floats(ROWS * cols, 2.0)).collect();
        for kernels in levels() {
            let data = WeightData::I8 { q: &q, scale: &scale };
            let w = kernels.pack(Weights { rows: out, cols, data }, None);
            let mut alone = Exec::new(kernels, 1, cols).unwrap();
            let expected = inputs.iter().map(|x| {
                let mut y = vec![0.0; ROWS * out];
                alone.linear(&w, x, ROWS, &mut y, Epilogue::Gelu);
                bits(&y)
            });
            let expected: Vec<_> = expected.collect();
            for threads in [1, 2] {
                let mut exec = Exec::new(kernels, threads, cols).unwrap().with_workers(cols).unwrap();
                for count in 0..inputs.len() {
                    let mut items: Vec<_> = inputs[..count].iter().map(|x| (x, vec![0.0; ROWS * out])).collect();
                    exec.begin();
                    exec.each(&mut items, |exec, (x, y)| exec.linear(&w, x, ROWS, y, Epilogue::Gelu));
                    exec.end();
                    assert!(items.iter().zip(&expected).all(|((_, y), expected)| bits(y) == *expected), "{exec:?}");
                }
            }
        }
    }
}
