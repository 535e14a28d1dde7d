//! Sessions come and go without a trace: engines and sessions made, used and dropped, with no memory, thread or file left.
//!
//! `VISAVIS_CYCLES` sets the number of sessions; 300 by default, 10,000 in the figures of the README. One test in one binary, so
//! that no other test's threads and memory are counted.
#![cfg(target_os = "linux")]

mod common;

use common::tiny;
use glam::Vec3;
use visavis::frame::Sampler;
use visavis::session::{Anchoring, SessionOptions};

/// Resident memory, bytes; threads; open files.
fn footprint() -> [usize; 3] {
    let statm = std::fs::read_to_string("/proc/self/statm").expect("statm");
    let pages: usize = statm.split(' ').nth(1).and_then(|n| n.parse().ok()).expect("resident pages");
    let count = |folder| std::fs::read_dir(folder).expect("a folder of /proc").count();
    [pages * 4096, count("/proc/self/task"), count("/proc/self/fd")]
}

#[test]
fn sessions_leave_nothing_behind() {
    let cycles: usize = std::env::var("VISAVIS_CYCLES").map_or(300, |n| n.parse().expect("a number of sessions"));
    let engine = tiny();
    let samplers = [Sampler::Midpoint(4), Sampler::Single, Sampler::Euler(5)];
    let cycle = |i: usize| {
        let options = SessionOptions {
            threads: 1 + usize::from(i % 4 == 3),
            sampler: samplers[i % samplers.len()],
            anchoring: Anchoring::Every(2),
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
        if i.is_multiple_of(50) {
            drop(tiny());
        }
    };
    // Allocators keep some of what they were given back; after a third they have had their chance.
    (0..cycles.div_ceil(3)).for_each(cycle);
    let before = footprint();
    (0..cycles).for_each(cycle);
    // A helper thread of the last session may still be on its way out.
    let after = (0..100)
        .map(|_| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            footprint()
        })
        .find(|after| after[1] <= before[1])
        .expect("no thread is left behind");
    println!("{cycles} sessions: {before:?} before, {after:?} after (bytes, threads, files)");
    assert_eq!(before[2], after[2], "files are left open");
    // A leaked session is megabytes, hundreds of them are hundreds; what an allocator keeps for the threads of 300 sessions was seen to be 12.
    let grown = after[0].saturating_sub(before[0]);
    assert!(grown < 32 << 20, "{grown} bytes more after {cycles} sessions");
}
