//! A bounded queue of small records between threads that must not wait for each other.
//!
//! Vyukov's bounded queue, with records of atomic words in place of raw memory, and without its
//! spinning: a writer that lost its core in the middle of a record hides that record, and those
//! behind it, until it goes on. Nobody waits for it. (The queues of `crossbeam-queue` and
//! `concurrent-queue` spin in such a case: a thread with a deadline would wait for one without a
//! core.)

use std::cmp::Ordering::{Equal, Greater, Less};
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

/// Any number of threads write records of up to `WORDS` words, any number read them; each record is
/// read once, in the order in which writers took their places. Nothing here waits, or allocates
/// after the queue was made.
pub(crate) struct Queue<const WORDS: usize> {
    /// For each place its state, then its record. The state is `2 lap` when the place is free for
    /// lap `lap`, `2 lap + 1` when it holds that lap's record: zeros are an empty queue, and
    /// untouched places take no memory.
    places: Box<[AtomicU64]>,
    capacity: u64,
    /// Records whose places writers have taken, and that readers have.
    tail: AtomicU64,
    head: AtomicU64,
}

impl<const WORDS: usize> Queue<WORDS> {
    /// Room for `capacity` records (at least 1).
    pub(crate) fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Self {
            places: bytemuck::allocation::zeroed_slice_box(capacity * (WORDS + 1)),
            capacity: capacity as u64,
            tail: AtomicU64::new(0),
            head: AtomicU64::new(0),
        }
    }

    /// State and words of the place of record `at`, and its lap.
    fn place(&self, at: u64) -> (&AtomicU64, &[AtomicU64], u64) {
        let from = (at % self.capacity) as usize * (WORDS + 1);
        let place = &self.places[from..from + WORDS + 1];
        (&place[0], &place[1..], at / self.capacity)
    }

    /// Appends `record` (at most `WORDS` words); false when there is no room.
    pub(crate) fn push(&self, record: &[u64]) -> bool {
        let mut at = self.tail.load(Relaxed);
        loop {
            let (state, words, lap) = self.place(at);
            // Acquire: the reader of the lap before is done with the words.
            match state.load(Acquire).cmp(&(2 * lap)) {
                Equal => match self.tail.compare_exchange_weak(at, at + 1, Relaxed, Relaxed) {
                    Ok(_) => {
                        words.iter().zip(record).for_each(|(to, word)| to.store(*word, Relaxed));
                        state.store(2 * lap + 1, Release);
                        return true;
                    }
                    Err(now) => at = now,
                },
                Less => return false,
                Greater => at = self.tail.load(Relaxed),
            }
        }
    }

    /// Takes the oldest record into `record` (of which words beyond its own mean nothing); false
    /// when there is none, or when it is still being written.
    pub(crate) fn pop(&self, record: &mut [u64; WORDS]) -> bool {
        let mut at = self.head.load(Relaxed);
        loop {
            let (state, words, lap) = self.place(at);
            // Acquire: the writer is done with the words.
            match state.load(Acquire).cmp(&(2 * lap + 1)) {
                Equal => match self.head.compare_exchange_weak(at, at + 1, Relaxed, Relaxed) {
                    Ok(_) => {
                        record.iter_mut().zip(words).for_each(|(to, word)| *to = word.load(Relaxed));
                        state.store(2 * (lap + 1), Release);
                        return true;
                    }
                    Err(now) => at = now,
                },
                Less => return false,
                Greater => at = self.head.load(Relaxed),
            }
        }
    }

    /// Whether there is a record to take.
    pub(crate) fn is_ready(&self) -> bool {
        let at = self.head.load(Acquire);
        let (state, _, lap) = self.place(at);
        state.load(Acquire) > 2 * lap
    }

    /// Places that are free, as far as one thread can tell while others are at work.
    pub(crate) fn room(&self) -> usize {
        let (head, tail) = (self.head.load(Relaxed), self.tail.load(Relaxed));
        self.capacity.saturating_sub(tail.saturating_sub(head)) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn records_come_out_in_order_until_it_is_full() {
        let queue = Queue::<2>::new(3);
        let mut record = [0; 2];
        assert!(!queue.pop(&mut record) && !queue.is_ready());
        for lap in 0..5 {
            (0..3).for_each(|i| assert!(queue.push(&[10 * lap + i, 7]) && queue.is_ready()));
            assert!(!queue.push(&[0]) && queue.room() == 0);
            (0..3).for_each(|i| assert!(queue.pop(&mut record) && record == [10 * lap + i, 7]));
            assert!(!queue.pop(&mut record) && queue.room() == 3);
        }
    }

    /// Each record is read once and whole; those of one writer in their order.
    #[test]
    fn many_writers_and_readers() {
        const RECORDS: u64 = if cfg!(miri) { 50 } else { 20_000 };
        let (queue, read) = (Queue::<3>::new(16), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for writer in 0..3u64 {
                let queue = &queue;
                scope.spawn(move || {
                    for i in 0..RECORDS {
                        while !queue.push(&[writer, i, writer ^ i]) {
                            std::thread::yield_now();
                        }
                    }
                });
            }
            let reader = || {
                let (mut next, mut record) = ([0; 3], [0; 3]);
                while read.load(Relaxed) < 3 * RECORDS as usize {
                    if queue.pop(&mut record) {
                        let [writer, i, check] = record;
                        assert!(check == writer ^ i && i >= next[writer as usize], "{record:?}");
                        next[writer as usize] = i + 1;
                        read.fetch_add(1, Relaxed);
                    } else {
                        std::thread::yield_now();
                    }
                }
            };
            scope.spawn(reader);
            scope.spawn(reader);
        });
        assert_eq!((read.into_inner() as u64, queue.room()), (3 * RECORDS, 16));
    }
}
