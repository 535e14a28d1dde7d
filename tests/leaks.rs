//! Engines and sessions come and go without a trace: loaded, made, used and dropped, with no
//! memory, thread or file left.
//!
//! `VISAVIS_CYCLES` sets the number of cycles; 300 by default, 10,000 in the figures of the README.
//! Memory is what the allocator was asked for and not given back, to the byte; resident memory is
//! told too. One test in one binary, so that no other test's threads and memory are counted.
#![cfg(target_os = "linux")]

mod common;

use common::tiny;
use glam::Vec3;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicIsize, Ordering};
use visavis::internals::session::Anchoring;
use visavis::{Sampler, SessionOptions};

/// The system's allocator, counting bytes that are in use.
struct Counting;

static LIVE: AtomicIsize = AtomicIsize::new(0);

// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract.
#[allow(unsafe_code, reason = "a global allocator is unsafe by nature")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LIVE.fetch_add(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        LIVE.fetch_add(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: `ptr` came from `System` with this layout.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Bytes in use, resident bytes, threads, open files.
fn footprint() -> [isize; 4] {
    let live = LIVE.load(Ordering::SeqCst);
    let statm = std::fs::read_to_string("/proc/self/statm").expect("statm");
    let pages: isize = statm.split(' ').nth(1).and_then(|n| n.parse().ok()).expect("resident pages");
    let count = |folder| std::fs::read_dir(folder).expect("a folder of /proc").count() as isize;
    [live, pages * 4096, count("/proc/self/task"), count("/proc/self/fd")]
}

/// Bytes by which one moment may differ from another: threads that just ended, the test's own text.
const SLACK: isize = 16 << 10;

#[test]
fn engines_and_sessions_leave_nothing_behind() {
    let cycles: usize = std::env::var("VISAVIS_CYCLES").map_or(300, |n| n.parse().expect("a number of sessions"));
    let samplers = [Sampler::Midpoint4, Sampler::Single, Sampler::euler(5).unwrap()];
    let cycle = |i: usize| {
        let engine = tiny();
        let options = SessionOptions {
            threads: 1 + usize::from(i % 4 == 3),
            sampler: samplers[i % samplers.len()],
            diagnostics: Anchoring::Every(2).into(),
            ..Default::default()
        };
        let mut session = engine.session(options).expect("a session");
        session.push_agent_audio(&[0.1; 960], [24_000, 48_000, 44_100][i % 3]).expect("sound");
        session.push_user_head(Vec3::new(0.0, 1.6, 2.0), 0.0).expect("a head");
        for _ in 0..i % 4 {
            assert!(session.poll(session.next_due()).expect("a poll").is_some());
        }
        if i.is_multiple_of(5) {
            session.reset().expect("a reset");
        }
        // Errors leave nothing either.
        assert!(engine.session(SessionOptions { threads: 9, ..Default::default() }).is_err());
    };
    // What is made once and kept is made in the first third.
    (0..cycles.div_ceil(3)).for_each(cycle);
    let before = footprint();
    (0..cycles).for_each(cycle);
    // A helper thread of the last session may still be on its way out.
    let after = (0..100)
        .map(|_| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            footprint()
        })
        .find(|after| after[2] <= before[2])
        .expect("no thread is left behind");
    println!(
        "{cycles} engines and sessions: {before:?} before, {after:?} after (bytes in use, resident bytes, threads, files)"
    );
    assert_eq!(before[3], after[3], "files are left open");
    assert!(after[0] - before[0] < SLACK, "{} bytes more in use after {cycles} cycles", after[0] - before[0]);
    // A leak around the allocator (a mapping, a thread's stack) would be megabytes a cycle; what
    // the C library keeps for the threads of 300 sessions was seen to be 12 MB.
    let grown = after[1] - before[1];
    assert!(grown < 32 << 20, "{grown} bytes more resident after {cycles} cycles");
}
