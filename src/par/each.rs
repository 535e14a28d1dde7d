//! Things of any kind shared out over the pool, each to one thread.

use super::Pool;
use std::sync::atomic::{AtomicBool, Ordering};

/// The start of a slice whose elements threads take one by one.
struct Elements<T>(*mut T);
// SAFETY: whoever holds it reaches disjoint elements alone: sharing it hands elements to other
// threads, which `T: Send` allows.
unsafe impl<T: Send> Sync for Elements<T> {}

impl<T> Elements<T> {
    /// Element `i`.
    ///
    /// # Safety
    /// It lies in the slice, and no other reference to it lives meanwhile.
    #[allow(clippy::mut_from_ref, reason = "each reference is the only one to its element")]
    unsafe fn at(&self, i: usize) -> &mut T {
        // SAFETY: promised by the caller.
        unsafe { &mut *self.0.add(i) }
    }
}

/// One of two places, held by a thread; the first is free again when it is dropped, in a panic too.
struct Place<'a> {
    first: &'a AtomicBool,
    number: usize,
}

impl<'a> Place<'a> {
    /// The first place, or the second while another thread has that.
    ///
    /// Two threads are never in one place: the second is entered only while the other thread is in
    /// the first, and whoever comes back to find the other in the second finds the first free.
    /// `AcqRel` hands on what was done in either.
    fn take(first: &'a AtomicBool) -> Self {
        Self { first, number: usize::from(first.swap(true, Ordering::AcqRel)) }
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        if self.number == 0 {
            self.first.store(false, Ordering::Release);
        }
    }
}

impl Pool {
    /// Calls `work(i, item)` once for each of `items`, on both threads if the helper is awake.
    ///
    /// # Panics
    /// As [`Pool::run`].
    pub fn each<T: Send>(&mut self, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
        self.each_with(&mut [(), ()], items, |(), i, item| work(i, item));
    }

    /// The same with something for each thread to work with: `tools` are of no thread in
    /// particular, but no two calls at a time get the same one.
    ///
    /// # Panics
    /// As [`Pool::run`].
    pub fn each_with<S: Send, T: Send>(
        &mut self,
        tools: &mut [S; 2],
        items: &mut [T],
        work: impl Fn(&mut S, usize, &mut T) + Sync,
    ) {
        let (first, tools) = (AtomicBool::new(false), Elements(tools.as_mut_ptr()));
        let (count, items) = (items.len(), Elements(items.as_mut_ptr()));
        self.run(count, &|i, _| {
            let place = Place::take(&first);
            // SAFETY: a place is 0 or 1, and has one thread at a time: a pool has two.
            let tools = unsafe { tools.at(place.number) };
            // SAFETY: `i` is below `count`, and no other call gets it.
            work(tools, i, unsafe { items.at(i) });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn each_item_once_with_a_tool_that_is_nobody_elses() {
        for threads in [1, 2] {
            let mut pool = Pool::new(threads).unwrap();
            let mut calls = [0u64; 2];
            let mut expected = 0;
            for round in 0..200 {
                if round == 1 {
                    pool.begin();
                }
                let mut items: Vec<(usize, Vec<u64>)> = (0..round % 23).map(|i| (i, Vec::new())).collect();
                expected += items.len() as u64;
                pool.each_with(&mut calls, &mut items, |calls, i, (number, log)| {
                    assert_eq!(i, *number);
                    // A tool that two threads had at once would lose counts.
                    for _ in 0..100 {
                        *std::hint::black_box(&mut *calls) += 1;
                    }
                    log.push(*calls);
                });
                assert!(items.iter().all(|(_, log)| log.len() == 1));
                pool.each(&mut items, |i, (_, log)| log.push(i as u64));
                assert!(items.iter().all(|(i, log)| log[1] == *i as u64));
            }
            pool.end();
            assert_eq!(calls[0] + calls[1], 100 * expected);
        }
    }

    #[test]
    fn a_panic_leaves_the_other_items_and_tools_sound() {
        let mut pool = Pool::new(2).unwrap();
        pool.begin();
        for bad in 0..20 {
            let (mut tools, mut items) = ([0u64; 2], [0u64; 20]);
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                pool.each_with(&mut tools, &mut items, |calls, i, item| {
                    *calls += 1;
                    assert!(i != bad, "item {i}");
                    *item += 1;
                });
            }));
            assert_eq!(*outcome.unwrap_err().downcast::<String>().unwrap(), format!("item {bad}"));
            assert!(items.iter().all(|item| *item <= 1) && items[bad] == 0);
            assert_eq!(tools[0] + tools[1], items.iter().sum::<u64>() + 1);
        }
    }
}
