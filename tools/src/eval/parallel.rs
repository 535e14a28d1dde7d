//! The same work on many things, on a few threads.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use visavis::Result;

/// `work(i)` for `i` below `count`, in order, done by `threads` threads; the result does not depend
/// on how many. `done` is told how many are done, from any thread. The first error by order is
/// returned.
pub(super) fn each<T: Send>(
    threads: usize,
    count: usize,
    done: &(dyn Fn(usize) + Sync),
    work: &(dyn Fn(usize) -> Result<T> + Sync),
) -> Result<Vec<T>> {
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results = Mutex::new(Vec::with_capacity(count));
    std::thread::scope(|scope| {
        for _ in 0..threads.clamp(1, count.max(1)) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= count {
                        break;
                    }
                    let result = work(i);
                    // A poisoned lock means that another thread panics, which the scope passes on.
                    if let Ok(mut results) = results.lock() {
                        results.push((i, result));
                    }
                    done(finished.fetch_add(1, Ordering::Relaxed) + 1);
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    results.sort_by_key(|(i, _)| *i);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visavis::{Error, ErrorKind};

    #[test]
    fn order_and_errors_do_not_depend_on_threads() {
        for threads in [1, 2, 5] {
            assert_eq!(each(threads, 20, &|_| {}, &|i| Ok(i * i)).unwrap(), (0..20).map(|i| i * i).collect::<Vec<_>>());
            let fail = |i: usize| match i % 7 {
                3 => Err(Error::new(ErrorKind::State, i.to_string())),
                _ => Ok(()),
            };
            assert_eq!(each(threads, 20, &|_| {}, &fail).unwrap_err().to_string(), "3");
            assert!(each(threads, 0, &|_| {}, &fail).unwrap().is_empty());
        }
    }
}
