//! Computing blocks makes no system call: proved by computing them where one would be fatal.
//!
//! A child process enters seccomp's strict mode, in which the kernel kills it at any system call but read, write and
//! exit, computes blocks, and writes one byte to say that it is through. Sleeping on a contended lock, allocating from the
//! system, starting a thread or reading the environment would all be such a call. One test in one binary: the child
//! of a fork has only the thread that forked.
#![cfg(target_os = "linux")]
#![allow(unsafe_code, reason = "fork, prctl and exit are unsafe by nature")]

mod common;

use common::{Inputs, tiny};
use visavis::frame::Sampler;
use visavis::session::{Session, SessionOptions};

/// What became of a child that ran `work` in strict mode.
#[derive(Debug, PartialEq)]
enum Fate {
    /// It came through.
    Through,
    /// The kernel killed it.
    Killed,
    /// Strict mode is not to be had here (some containers and emulators).
    Unavailable,
}

fn confined(work: impl FnOnce()) -> Fate {
    let mut ends = [0; 2];
    // SAFETY: `ends` has room for both ends of the pipe.
    assert_eq!(unsafe { libc::pipe(ends.as_mut_ptr()) }, 0);
    // SAFETY: the child calls nothing that needs another thread: neither it nor the blocks it computes allocate or lock.
    let child = unsafe { libc::fork() };
    assert!(child >= 0, "fork");
    if child == 0 {
        // SAFETY: plain numbers.
        let confined = unsafe { libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_STRICT) } == 0;
        if confined {
            work();
        }
        let answer = [u8::from(confined) + 1];
        // SAFETY: one byte from `answer`; then the thread, the only one, ends without cleaning up. `exit`, not
        // `exit_group`: strict mode allows the former alone.
        unsafe {
            libc::write(ends[1], answer.as_ptr().cast(), 1);
            libc::syscall(libc::SYS_exit, 0);
        }
        unreachable!("the child has ended");
    }
    let (mut answer, mut status) = ([0u8], 0);
    // SAFETY: room for one byte; `child` is our child.
    let read = unsafe {
        libc::close(ends[1]);
        libc::waitpid(child, &mut status, 0);
        let read = libc::read(ends[0], answer.as_mut_ptr().cast(), 1);
        libc::close(ends[0]);
        read
    };
    match (read, answer[0]) {
        (1, 2) => Fate::Through,
        (1, 1) => Fate::Unavailable,
        _ => Fate::Killed,
    }
}

fn compute(session: &mut Session, blocks: usize) {
    for block in 0..blocks {
        let sampler = [Sampler::Midpoint(4), Sampler::Single, Sampler::Midpoint(2)][block / 4 % 3];
        let ok = session.set_sampler(sampler).is_ok();
        let now = session.next_due();
        std::hint::black_box(ok && session.poll(now).is_ok_and(|frames| frames.is_some()));
    }
}

#[test]
fn blocks_make_no_system_call() {
    let inputs = Inputs::circling(8.0, 24_000);
    let mut session = tiny().session(SessionOptions { gaze: Some(0.7), ..Default::default() }).unwrap();
    common::run(&mut session, &inputs, 1);

    match confined(|| drop(std::hint::black_box(std::fs::metadata("/")))) {
        Fate::Unavailable => {
            println!("skipped: seccomp's strict mode is not available here");
            return;
        }
        fate => assert_eq!(fate, Fate::Killed, "a system call is fatal in the child"),
    }
    assert_eq!(confined(|| compute(&mut session, 40)), Fate::Through);
}
