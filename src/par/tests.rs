//! Tests of the pool.

use super::cores::current_thread_id;
use super::{Next, Pool};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

#[test]
fn every_piece_once_over_many_runs() {
    for threads in [1, 2] {
        let mut pool = Pool::new(threads).unwrap();
        assert_eq!(pool.threads(), threads);
        for round in 0..3 {
            if round > 0 {
                pool.begin();
            }
            for pieces in (0..200).chain([1000]) {
                let counts: Vec<AtomicUsize> = (0..pieces).map(|_| AtomicUsize::new(0)).collect();
                pool.run(pieces, &|i, next| {
                    assert!(match next {
                        Next::Piece(next) => next.abs_diff(i) == 1 && next < pieces,
                        Next::First | Next::Last => true,
                    });
                    counts[i].fetch_add(1, Ordering::Relaxed);
                });
                assert!(counts.iter().all(|c| c.load(Ordering::Relaxed) == 1));
            }
            pool.end();
        }
    }
}

#[test]
fn both_threads_work() {
    let mut pool = Pool::new(2).unwrap();
    pool.begin();
    let caller = thread::current().id();
    let helped = AtomicBool::new(false);
    // Ends when the helper has taken a piece; the caller's pieces wait for that.
    pool.run(2, &|_, _| {
        if thread::current().id() == caller {
            while !helped.load(Ordering::Acquire) {
                thread::yield_now();
            }
        } else {
            helped.store(true, Ordering::Release);
        }
    });
    assert!(helped.load(Ordering::Acquire));
}

#[test]
fn the_helper_is_known_and_can_be_pinned() {
    let (mut one, mut two) = (Pool::new(1).unwrap(), Pool::new(2).unwrap());
    assert_eq!(one.helper_id(), None);
    assert!(one.pin_helper(0).is_ok(), "there is nobody to pin");
    if cfg!(target_os = "linux") {
        assert!(two.helper_id().is_some_and(|id| Some(id) != current_thread_id()));
        two.pin_helper(u64::MAX).unwrap();
        assert!(two.pin_helper(0).is_err());
    }
}

#[test]
fn panics_come_out_and_the_pool_lives_on() {
    let mut pool = Pool::new(2).unwrap();
    pool.begin();
    for bad in 0..20 {
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            pool.run(20, &|i, _| assert!(i != bad, "piece {i}"));
        }));
        let message = *outcome.unwrap_err().downcast::<String>().unwrap();
        assert_eq!(message, format!("piece {bad}"));
    }
    let sum = AtomicUsize::new(0);
    pool.run(20, &|i, _| {
        sum.fetch_add(i, Ordering::Relaxed);
    });
    assert_eq!(sum.into_inner(), 190);
}

/// What `rounds` runs of 20 pieces compute, each a stretch of its own; how many of them the helper
/// had a part in.
fn stretches(pool: &mut Pool, rounds: usize) -> usize {
    let caller = thread::current().id();
    let mut helped = 0;
    for round in 0..rounds {
        let results: Vec<AtomicUsize> = (0..20).map(|_| AtomicUsize::new(0)).collect();
        let by_helper = AtomicUsize::new(0);
        pool.begin();
        pool.run(20, &|i, _| {
            if thread::current().id() != caller {
                by_helper.fetch_add(1, Ordering::Relaxed);
            }
            // Long enough for the helper to wake up meanwhile.
            let sum = (0..100_000usize).fold(i, |sum, n| std::hint::black_box(sum.wrapping_add(n ^ round)));
            results[i].fetch_add(sum, Ordering::Relaxed);
        });
        pool.end();
        for (i, result) in results.iter().enumerate() {
            assert_eq!(result.load(Ordering::Relaxed), (0..100_000).fold(i, |sum, n| sum.wrapping_add(n ^ round)));
        }
        helped += usize::from(by_helper.into_inner() > 0);
    }
    helped
}

#[test]
fn a_stalled_helper_is_left_alone_and_comes_back() {
    let mut pool = Pool::new(2).unwrap();
    // Stalls one after the other, until one has met a piece of the helper's and used up its credit.
    while pool.together() {
        pool.stall(50, true);
        stretches(&mut pool, 1);
    }
    pool.stall(0, true);
    assert_eq!(stretches(&mut pool, 1), 0, "alone");
    // It may be sent away again where other tests want the cores, and then comes back again.
    while stretches(&mut pool, 1) == 0 {}
}

#[test]
fn a_helper_that_stalls_without_a_piece_is_not_waited_for() {
    let mut pool = Pool::new(2).unwrap();
    pool.begin();
    // It is awake: a piece was its.
    let caller = thread::current().id();
    let helped = AtomicBool::new(false);
    let all = |_: usize, _: Next| {
        if thread::current().id() == caller {
            while !helped.load(Ordering::Acquire) {
                thread::yield_now();
            }
        } else {
            helped.store(true, Ordering::Release);
        }
    };
    pool.run(2, &all);
    // An hour: a caller that waited for it would never come back.
    pool.stall(3_600_000, false);
    let sum = AtomicUsize::new(0);
    for _ in 0..100 {
        pool.run(20, &|i, _| {
            sum.fetch_add(i, Ordering::Relaxed);
        });
    }
    pool.end();
    assert_eq!(sum.into_inner(), 19_000);
    // Dropping it would wait for the helper.
    std::mem::forget(pool);
}
