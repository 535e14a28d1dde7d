//! The pool: one caller, at most one helper.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::apart::Apart;
use super::cores::{current_thread_id, time_on_core};
use super::ledger::{Ledger, Stretch};
use super::shared::{Next, Shared, Work};
use crate::clock::Instant;
use crate::error::Result;

/// Pieces of one [`Pool::run`], at most.
const MAX_PIECES: usize = u16::MAX as usize;

/// Spins at the end of a run after which the caller's wait for the helper is timed.
const PATIENCE: u32 = 1 << 10;
/// Spins after which the caller lets another thread have its core; about a millisecond, reached
/// only where the helper lost its own.
const SPINS: u32 = 1 << 15;

/// One or two threads that share out the pieces of a loop.
pub struct Pool {
    shared: Arc<Shared>,
    helper: Option<Helper>,
    run: u32,
}

/// The second thread.
struct Helper {
    thread: JoinHandle<()>,
    id: Option<u32>,
    apart: Apart,
    ledger: Ledger,
    /// Since the last [`Pool::begin`].
    stretch: Stretch,
    /// When that was, and what the caller had had of a core by then.
    began: Option<(Instant, Duration)>,
}

impl Pool {
    /// A pool of `threads` threads, the caller included: 1 starts none, 2 (or more) starts one
    /// helper, parked.
    ///
    /// # Errors
    /// When the operating system cannot start a thread.
    pub fn new(threads: usize) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        if threads < 2 {
            return Ok(Self { shared, helper: None, run: 0 });
        }
        let (tell, told) = mpsc::channel();
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new().name("visavis-helper".into()).spawn(move || {
            let _ = tell.send(current_thread_id());
            drop(tell);
            theirs.help();
        })?;
        let id = told.recv().ok().flatten();
        let (apart, ledger, stretch) = (Apart::new(id), Ledger::new(), Stretch::default());
        Ok(Self { shared, helper: Some(Helper { thread, id, apart, ledger, stretch, began: None }), run: 0 })
    }

    /// Number of threads: 1 or 2.
    pub fn threads(&self) -> usize {
        1 + usize::from(self.helper.is_some())
    }

    /// Whether the helper takes part from the next [`begin`](Self::begin) on: false without one,
    /// and while it costs more than it saves.
    #[cfg(any(test, feature = "internals"))]
    pub fn together(&self) -> bool {
        self.helper.as_ref().is_some_and(|helper| helper.ledger.together())
    }

    /// The kernel's id of the helper thread; `None` without a helper, or where threads have no such
    /// id.
    pub fn helper_id(&self) -> Option<u32> {
        self.helper.as_ref()?.id
    }

    /// Lets the helper run only on the cores of `mask` (bit i: core i); does nothing without a
    /// helper.
    ///
    /// # Errors
    /// As [`super::pin_current_thread`].
    pub fn pin_helper(&mut self, mask: u64) -> Result<()> {
        self.helper.as_mut().map_or(Ok(()), |helper| helper.apart.choose(mask))
    }

    /// Wakes the helper; from now until [`end`](Self::end) it looks for work: spinning, and in
    /// short naps when there is none for long.
    ///
    /// Where other work wants the cores, so that the helper costs more than it saves, it is left
    /// asleep.
    pub fn begin(&mut self) {
        let Some(helper) = &mut self.helper else { return };
        if helper.began.is_none() {
            helper.began = Some((Instant::now(), time_on_core()));
            helper.stretch = Stretch::default();
        }
        if helper.ledger.together() {
            helper.apart.keep();
            self.shared.awake.0.store(true, Ordering::Release);
            helper.thread.thread().unpark();
        }
    }

    /// Lets the helper park. On the thread that called [`begin`](Self::begin).
    pub fn end(&mut self) {
        self.shared.awake.0.store(false, Ordering::Release);
        let Some(helper) = &mut self.helper else { return };
        if let Some((began, on_core)) = helper.began.take() {
            let elapsed = began.elapsed();
            let off = elapsed.saturating_sub(time_on_core().saturating_sub(on_core));
            helper.ledger.enter(&Stretch { elapsed, off, ..helper.stretch });
        }
    }

    /// Calls `work(i, next)` once for each i in `0..pieces`, here and on the helper if it is awake;
    /// returns when all have returned. `next` is where the same thread goes on, unless the other
    /// one is faster.
    ///
    /// # Panics
    /// With the panic of a piece, after all pieces that were begun have ended. With more than
    /// 65,535 pieces.
    pub fn run(&mut self, pieces: usize, work: &(dyn Fn(usize, Next) + Sync)) {
        if let Some(helper) = &mut self.helper {
            helper.stretch.pieces += pieces as u64;
        }
        let helper = self.helper.as_mut();
        let shared = &*self.shared;
        let (Some(helper), true) = (helper, pieces > 1 && shared.awake.0.load(Ordering::Relaxed)) else {
            (0..pieces)
                .for_each(|piece| work(piece, if piece + 1 < pieces { Next::Piece(piece + 1) } else { Next::First }));
            return;
        };
        assert!(pieces <= MAX_PIECES, "too many pieces");
        // SAFETY: no piece of the last run is left or being worked on, so the helper does not read
        // `work`. The lifetime is erased: the pointer is used only for pieces of this run, and this
        // function does not return or unwind before they have ended.
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
        helper.wait(shared, pieces as u32 - mine);
        if let Err(payload) = outcome {
            resume_unwind(payload);
        }
        if shared.panicked.swap(false, Ordering::Relaxed) {
            let payload = shared.payload.lock().unwrap_or_else(PoisonError::into_inner).take();
            resume_unwind(payload.unwrap_or_else(|| Box::new("the helper thread panicked")));
        }
    }

    /// Lets the helper sleep for `ms` before it takes the next piece, or with the next one that it
    /// takes.
    #[cfg(test)]
    pub(crate) fn stall(&self, ms: u32, with_a_piece: bool) {
        self.shared.stalls[usize::from(with_a_piece)].store(ms, Ordering::Relaxed);
    }
}

impl Helper {
    /// Waits until the helper has done `theirs` pieces. One that kept the caller waiting for too
    /// long leaves the stretch.
    ///
    /// Nothing else can be done meanwhile: the helper's piece borrows what the run was given.
    fn wait(&mut self, shared: &Shared, theirs: u32) {
        self.stretch.helped += u64::from(theirs);
        let (mut spins, mut since) = (0u32, None);
        while shared.done.0.load(Ordering::Acquire) != theirs {
            spins = spins.wrapping_add(1);
            if spins == PATIENCE {
                since.get_or_insert_with(Instant::now);
            }
            if spins.is_multiple_of(SPINS) {
                thread::yield_now();
            }
            std::hint::spin_loop();
        }
        if let Some(since) = since {
            self.stretch.waited += since.elapsed();
            if self.ledger.exceeds(self.stretch.waited) {
                shared.awake.0.store(false, Ordering::Release);
            }
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.shared.quit.store(true, Ordering::Release);
        self.shared.awake.0.store(false, Ordering::Release);
        if let Some(Helper { thread, .. }) = self.helper.take() {
            thread.thread().unpark();
            // The helper catches panics of the work, so there is nothing to report.
            let _ = thread.join();
        }
    }
}

impl std::fmt::Debug for Pool {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Pool({} threads)", self.threads())
    }
}
