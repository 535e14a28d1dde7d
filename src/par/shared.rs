//! What caller and helper share: the pieces of a run, and the helper's loop.

use std::any::Any;
use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use super::FlushToZero;

/// Spins without a piece after which the helper naps: well over what lies between two runs. A
/// helper that finds nothing for longer may be what the caller waits for a core for.
const IDLE: u32 = 1 << 14;
/// How long a nap lasts.
const NAP: Duration = Duration::from_micros(500);

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
pub(super) type Work<'a> = dyn Fn(usize, Next) + Sync + 'a;

/// Keeps what the threads write out of each other's cache lines.
#[repr(align(128))]
#[derive(Default)]
pub(super) struct Line<T>(pub(super) T);

#[derive(Default)]
pub(super) struct Shared {
    /// Pieces left: run number (32 bits), first (16), end (16).
    pub(super) ticket: Line<AtomicU64>,
    /// Pieces of this run that the helper has finished.
    pub(super) done: Line<AtomicU32>,
    pub(super) awake: Line<AtomicBool>,
    pub(super) quit: AtomicBool,
    pub(super) panicked: AtomicBool,
    /// The current work. Written by the caller while no piece is left; read by the helper between
    /// taking a piece and counting it.
    pub(super) work: UnsafeCell<Option<*const Work<'static>>>,
    pub(super) payload: Mutex<Option<Box<dyn Any + Send>>>,
    /// Milliseconds that the helper sleeps before it takes a piece, and with one that it has just
    /// taken; once.
    #[cfg(test)]
    pub(super) stalls: [AtomicU32; 2],
}

// SAFETY: `work` is the one field that is not Sync by itself; taking a piece acquires the caller's
// release of the ticket that followed its write, and the caller writes again only after it has
// acquired the helper's count of every piece taken.
unsafe impl Sync for Shared {}
// SAFETY: the pointer in `work` is to a `Sync` closure that outlives the run.
unsafe impl Send for Shared {}

impl Shared {
    /// Takes a piece of the current run, from the front or the back. Of two that are left the other
    /// thread takes the second.
    pub(super) fn take(&self, front: bool) -> Option<(usize, Next)> {
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

    /// What the helper does until the pool is dropped.
    pub(super) fn help(&self) {
        while !self.quit.load(Ordering::Acquire) {
            if !self.awake.0.load(Ordering::Acquire) {
                thread::park();
                continue;
            }
            let _flush = FlushToZero::new();
            let mut idle = 0;
            while self.awake.0.load(Ordering::Relaxed) {
                #[cfg(test)]
                self.stall(0);
                let Some((piece, next)) = self.take(false) else {
                    idle += 1;
                    if idle > IDLE {
                        thread::park_timeout(NAP);
                    }
                    std::hint::spin_loop();
                    continue;
                };
                idle = 0;
                #[cfg(test)]
                self.stall(1);
                // SAFETY: a taken piece keeps the caller in `run`, so `work` is set, not written
                // to, and what it points to is alive.
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

    #[cfg(test)]
    fn stall(&self, place: usize) {
        if self.stalls[place].load(Ordering::Relaxed) > 0 {
            thread::sleep(Duration::from_millis(self.stalls[place].swap(0, Ordering::Relaxed).into()));
        }
    }
}
