//! The pool: one caller, at most one helper.

use std::any::Any;
use std::cell::UnsafeCell;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};

use super::FlushToZero;
use super::cores::{self, current_thread_id};
use crate::error::Result;

/// Pieces of one [`Pool::run`], at most.
const MAX_PIECES: usize = u16::MAX as usize;

/// Spins before the caller lets another thread have its core; about a millisecond, reached only where the helper lost its own.
const SPINS: u32 = 1 << 15;

/// Where a thread probably goes on after a piece: a hint for prefetching.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// With this piece.
    Piece(usize),
    /// With the first piece of the next run.
    First,
    /// With the last piece of the next run.
    Last,
}

/// A piece, and where the thread goes on.
type Work<'a> = dyn Fn(usize, Next) + Sync + 'a;

/// Keeps what the threads write out of each other's cache lines.
#[repr(align(128))]
struct Line<T>(T);

struct Shared {
    /// Pieces left: run number (32 bits), first (16), end (16).
    ticket: Line<AtomicU64>,
    /// Pieces of this run that the helper has finished.
    done: Line<AtomicU32>,
    awake: Line<AtomicBool>,
    quit: AtomicBool,
    panicked: AtomicBool,
    /// The current work. Written by the caller while no piece is left; read by the helper between taking a piece and counting it.
    work: UnsafeCell<Option<*const Work<'static>>>,
    payload: Mutex<Option<Box<dyn Any + Send>>>,
}

// SAFETY: `work` is the one field that is not Sync by itself; taking a piece acquires the caller's release of the ticket that
// followed its write, and the caller writes again only after it has acquired the helper's count of every piece taken.
unsafe impl Sync for Shared {}
// SAFETY: the pointer in `work` is to a `Sync` closure that outlives the run.
unsafe impl Send for Shared {}

impl Shared {
    /// Takes a piece of the current run, from the front or the back. Of two that are left the other thread takes the second.
    fn take(&self, front: bool) -> Option<(usize, Next)> {
        let mut seen = self.ticket.0.load(Ordering::Relaxed);
        loop {
            let (first, end) = ((seen >> 16) & 0xffff, seen & 0xffff);
            if first >= end {
                return None;
            }
            let (piece, next) = if front { (first, seen + (1 << 16)) } else { (end - 1, seen - 1) };
            match self.ticket.0.compare_exchange_weak(seen, next, Ordering::Acquire, Ordering::Relaxed) {
                Ok(_) => {
                    let next = match (end - first > 2, front) {
                        (true, true) => Next::Piece(piece as usize + 1),
                        (true, false) => Next::Piece(piece as usize - 1),
                        (false, true) => Next::First,
                        (false, false) => Next::Last,
                    };
                    return Some((piece as usize, next));
                }
                Err(now) => seen = now,
            }
        }
    }

    fn help(&self) {
        while !self.quit.load(Ordering::Acquire) {
            if !self.awake.0.load(Ordering::Acquire) {
                thread::park();
                continue;
            }
            let _flush = FlushToZero::new();
            while self.awake.0.load(Ordering::Relaxed) {
                let Some((piece, next)) = self.take(false) else {
                    std::hint::spin_loop();
                    continue;
                };
                // SAFETY: a taken piece keeps the caller in `run`, so `work` is set, not written to, and what it points to is alive.
                let work = unsafe { (*self.work.get()).map(|w| &*w) };
                let outcome = catch_unwind(AssertUnwindSafe(|| {
                    if let Some(work) = work {
                        work(piece, next);
                    }
                }));
                if let Err(payload) = outcome {
                    *self.payload.lock().unwrap_or_else(PoisonError::into_inner) = Some(payload);
                    self.panicked.store(true, Ordering::Relaxed);
                }
                self.done.0.fetch_add(1, Ordering::Release);
            }
        }
    }
}

/// One or two threads that share out the pieces of a loop.
pub struct Pool {
    shared: Arc<Shared>,
    helper: Option<JoinHandle<()>>,
    helper_id: Option<u32>,
    run: u32,
}

impl Pool {
    /// A pool of `threads` threads, the caller included: 1 starts none, 2 (or more) starts one helper, parked.
    ///
    /// # Errors
    /// When the operating system cannot start a thread.
    pub fn new(threads: usize) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            ticket: Line(AtomicU64::new(0)),
            done: Line(AtomicU32::new(0)),
            awake: Line(AtomicBool::new(false)),
            quit: AtomicBool::new(false),
            panicked: AtomicBool::new(false),
            work: UnsafeCell::new(None),
            payload: Mutex::new(None),
        });
        if threads < 2 {
            return Ok(Self { shared, helper: None, helper_id: None, run: 0 });
        }
        let (tell, told) = mpsc::channel();
        let theirs = Arc::clone(&shared);
        let helper = thread::Builder::new().name("visavis-helper".into()).spawn(move || {
            let _ = tell.send(current_thread_id());
            drop(tell);
            theirs.help();
        })?;
        Ok(Self { shared, helper: Some(helper), helper_id: told.recv().ok().flatten(), run: 0 })
    }

    /// Number of threads: 1 or 2.
    pub fn threads(&self) -> usize {
        1 + usize::from(self.helper.is_some())
    }

    /// The kernel's id of the helper thread; `None` without a helper, or where threads have no such id.
    pub fn helper_id(&self) -> Option<u32> {
        self.helper_id
    }

    /// Lets the helper run only on the cores of `mask` (bit i: core i); does nothing without a helper.
    ///
    /// # Errors
    /// As [`super::pin_current_thread`].
    pub fn pin_helper(&self, mask: u64) -> Result<()> {
        if self.helper.is_none() { Ok(()) } else { cores::pin(self.helper_id, mask) }
    }

    /// Wakes the helper; from now until [`end`](Self::end) it spins for work.
    pub fn begin(&mut self) {
        if let Some(helper) = &self.helper {
            self.shared.awake.0.store(true, Ordering::Release);
            helper.thread().unpark();
        }
    }

    /// Lets the helper park.
    pub fn end(&mut self) {
        self.shared.awake.0.store(false, Ordering::Release);
    }

    /// Calls `work(i, next)` once for each i in `0..pieces`, here and on the helper if it is awake; returns when all have returned.
    /// `next` is where the same thread goes on, unless the other one is faster.
    ///
    /// # Panics
    /// With the panic of a piece, after all pieces that were begun have ended. With more than 65,535 pieces.
    pub fn run(&mut self, pieces: usize, work: &(dyn Fn(usize, Next) + Sync)) {
        let awake = self.helper.is_some() && self.shared.awake.0.load(Ordering::Relaxed);
        if pieces < 2 || !awake {
            (0..pieces)
                .for_each(|piece| work(piece, if piece + 1 < pieces { Next::Piece(piece + 1) } else { Next::First }));
            return;
        }
        assert!(pieces <= MAX_PIECES, "too many pieces");
        let shared = &*self.shared;
        // SAFETY: no piece of the last run is left or being worked on, so the helper does not read `work`. The lifetime is erased:
        // the pointer is used only for pieces of this run, and this function does not return or unwind before they have ended.
        unsafe { *shared.work.get() = Some(std::mem::transmute::<*const Work<'_>, *const Work<'static>>(work)) };
        shared.done.0.store(0, Ordering::Relaxed);
        self.run = self.run.wrapping_add(1);
        shared.ticket.0.store(u64::from(self.run) << 32 | pieces as u64, Ordering::Release);

        let mut mine = 0u32;
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            while let Some((piece, next)) = shared.take(true) {
                mine += 1;
                work(piece, next);
            }
        }));
        while shared.take(true).is_some() {
            mine += 1;
        }
        let mut spins = 0;
        while shared.done.0.load(Ordering::Acquire) + mine != pieces as u32 {
            spins += 1;
            if spins % SPINS == 0 {
                thread::yield_now();
            }
            std::hint::spin_loop();
        }
        if let Err(payload) = outcome {
            resume_unwind(payload);
        }
        if shared.panicked.swap(false, Ordering::Relaxed) {
            let payload = shared.payload.lock().unwrap_or_else(PoisonError::into_inner).take();
            resume_unwind(payload.unwrap_or_else(|| Box::new("the helper thread panicked")));
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.quit.store(true, Ordering::Release);
        self.end();
        if let Some(helper) = self.helper.take() {
            helper.thread().unpark();
            // The helper catches panics of the work, so there is nothing to report.
            let _ = helper.join();
        }
    }
}

impl std::fmt::Debug for Pool {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Pool({} threads)", self.threads())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

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
        let (one, two) = (Pool::new(1).unwrap(), Pool::new(2).unwrap());
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
}
