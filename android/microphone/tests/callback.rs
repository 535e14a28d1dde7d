//! The audio thread's side allocates nothing: proved with an allocator that counts. One test in one
//! binary.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicU64, Ordering};
use visavis_microphone::{AudioInput, tap};

struct Counting;

static CALLS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        CALLS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: `ptr` came from `System` with this layout.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn neither_end_allocates() {
    let (mut tap, mut drain) = tap(48_000, 1_000);
    let (burst, mut out) = ([0.25; 192], [0.0; 500]);
    let before = CALLS.load(Ordering::SeqCst);
    for _ in 0..100 {
        tap.push(&burst);
        if drain.counters().captured % 5 == 0 {
            drain.read(&mut out);
        }
    }
    assert_eq!(CALLS.load(Ordering::SeqCst) - before, 0);
    assert!(drain.counters().dropped > 0, "the full ring was part of it");
}
