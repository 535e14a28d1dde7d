//! Neither computing blocks nor pushing makes a system call: proved by computing them where one
//! would be fatal.
//!
//! A child process installs a seccomp filter with which the kernel kills it at any system call but
//! write and exit (and the clock's, which `poll` reads before and after a block, and which is none
//! where the kernel maps the clock). It computes blocks and writes one byte to say that it is
//! through. Sleeping on a contended lock, allocating from the system, starting a thread or reading
//! the environment would all be fatal. One test in one binary: the child of a fork has only the
//! thread that forked.
#![cfg(target_os = "linux")]
#![allow(unsafe_code, reason = "fork, prctl and exit are unsafe by nature")]

mod common;

use common::{Inputs, dram, hearing, tiny};
use visavis::{Budget, Engine, Governor, Sampler, Session, SessionOptions, Speaker};

/// What became of a child that ran `work` under the filter.
#[derive(Debug, PartialEq)]
enum Fate {
    /// It came through.
    Through,
    /// The kernel killed it.
    Killed,
    /// There are no such filters here (some containers and emulators).
    Unavailable,
}

fn confined(work: impl FnOnce()) -> Fate {
    let mut ends = [0; 2];
    // SAFETY: `ends` has room for both ends of the pipe.
    assert_eq!(unsafe { libc::pipe(ends.as_mut_ptr()) }, 0);
    // SAFETY: the child calls nothing that needs another thread: neither it nor the blocks it
    // computes allocate or lock.
    let child = unsafe { libc::fork() };
    assert!(child >= 0, "fork");
    if child == 0 {
        let confined = confine();
        if confined {
            work();
        }
        let answer = [u8::from(confined) + 1];
        // SAFETY: one byte from `answer`; then the thread, the only one, ends without cleaning up.
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

/// Installs the filter for this process; whether that worked.
fn confine() -> bool {
    const LOAD_NUMBER: u16 = (libc::BPF_LD | libc::BPF_W | libc::BPF_ABS) as u16;
    const EQUAL: u16 = (libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K) as u16;
    const RETURN: u16 = (libc::BPF_RET | libc::BPF_K) as u16;
    let step = |code, k, jt| libc::sock_filter { code, jt, jf: 0, k };
    // Each equal number jumps over what is left to the last line.
    let mut program = [
        step(LOAD_NUMBER, 0, 0),
        step(EQUAL, libc::SYS_write as u32, 3),
        step(EQUAL, libc::SYS_exit as u32, 2),
        step(EQUAL, libc::SYS_clock_gettime as u32, 1),
        step(RETURN, libc::SECCOMP_RET_KILL_PROCESS, 0),
        step(RETURN, libc::SECCOMP_RET_ALLOW, 0),
    ];
    let filter = libc::sock_fprog { len: program.len() as u16, filter: program.as_mut_ptr() };
    // SAFETY: plain numbers; `filter` and the program it points to outlive the call, which copies
    // them.
    unsafe {
        libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
            && libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_FILTER, std::ptr::from_ref(&filter)) == 0
    }
}

fn compute(session: &mut Session, blocks: usize) {
    for block in 0..blocks {
        let sampler = [Sampler::Midpoint4, Sampler::Single, Sampler::Midpoint2][block / 4 % 3];
        let ok = session.set_sampler(sampler).is_ok();
        let now = session.next_due();
        std::hint::black_box(ok && session.poll(now).is_ok_and(|frames| frames.is_some()));
    }
}

#[test]
fn blocks_make_no_system_call() {
    for engine in [tiny(), hearing(), dram("tcn"), dram("lstm")] {
        blocks_of(&engine);
    }
}

fn blocks_of(engine: &std::sync::Arc<Engine>) {
    let inputs = Inputs::circling(8.0, 24_000);
    let mut session = engine.session(SessionOptions { gaze: Some(0.7), ..Default::default() }).unwrap();
    common::run(&mut session, &inputs, 1);

    match confined(|| drop(std::hint::black_box(std::fs::metadata("/")))) {
        Fate::Unavailable => {
            println!("skipped: seccomp filters are not available here");
            return;
        }
        fate => assert_eq!(fate, Fate::Killed, "a system call is fatal in the child"),
    }
    assert_eq!(confined(|| compute(&mut session, 40)), Fate::Through);

    let heard = session.sounds();
    let place = glam::Vec3::new(1.0, 1.5, -2.0);
    if heard.is_heard() {
        for id in 0..16 {
            heard.push(id, &[0.2; 24_000], 24_000, place).unwrap();
            heard.push(id, &[0.2; 4_800], 48_000, place).unwrap();
        }
        heard.push_ears(&[0.2; 480], &[0.1; 480], 48_000).unwrap();
    }
    let (voice, head, controls) = (session.voice_input(Speaker::User), session.head_input(), session.controls());
    let sound = [0.1; 480];
    let mut pushed = || {
        for i in 0..40 {
            let mut all = voice.push(&sound, inputs.rate).is_ok();
            match i % 8 {
                1 => voice.finish(),
                3 => voice.clear(),
                5 => voice.set_present(i < 20),
                _ => head.push(glam::Vec3::new(0.0, 1.6, 2.0), session.next_due()),
            }
            if heard.is_heard() {
                all &= heard.push(i as u32 % 20, &sound, 24_000, place).is_ok() && heard.end(30 + i as u32).is_ok();
                all &= heard.push_ears(&sound, &sound, 48_000).is_ok() && (i % 7 > 0 || heard.end_ears().is_ok());
            }
            all &= controls.set_gaze((i % 2 > 0).then_some(0.5)).is_ok();
            all &= controls.set_sampler([Sampler::Single, Sampler::Midpoint4][i % 2]).is_ok();
            let now = session.next_due();
            // A panic calls the system, which is fatal.
            assert!(all && session.poll(now).is_ok_and(|frames| frames.is_some()));
        }
    };
    assert_eq!(confined(&mut pushed), Fate::Through);

    session.set_governor(Governor::Budget(Budget::default())).unwrap();
    let governed = |session: &mut Session| {
        for block in 0..80 {
            let now = session.next_due();
            let ok = session.poll(now).is_ok_and(|frames| frames.is_some());
            let ms = if (10..30).contains(&block) { 150.0 } else { 5.0 };
            std::hint::black_box(ok && session.report_block_time(ms).is_ok());
        }
    };
    assert_eq!(confined(|| governed(&mut session)), Fate::Through);
    if engine.kind() == "sarah" {
        session.set_fallback(&dram("tcn")).unwrap();
        assert_eq!(confined(|| governed(&mut session)), Fate::Through);
        governed(&mut session);
        assert!(session.stats().governor.fallback_blocks > 0);
    }

    let mut team = engine.team(1).unwrap();
    let mut sessions = [1, 2].map(|seed| engine.session(SessionOptions { seed, ..Default::default() }).unwrap());
    sessions.iter_mut().for_each(|session| drop(common::run(session, &inputs, 1)));
    let mut together = || {
        let [a, b] = &mut sessions;
        let mut all = true;
        for _ in 0..40 {
            let (now_a, now_b) = (a.next_due(), b.next_due());
            all &= team.step(&mut [(&mut *a, now_a), (&mut *b, now_b)]).is_ok_and(|count| count == 2);
        }
        // A panic calls the system, which is fatal.
        assert!(all && team.shared_blocks() == 80);
    };
    assert_eq!(confined(&mut together), Fate::Through);
}
