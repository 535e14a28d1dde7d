//! After the first push of a voice or of a sound source, pushing and setting allocate nothing: proved with an allocator
//! that counts, thread by thread.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use visavis_c::*;

struct Counting;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        CALLS.set(CALLS.get() + 1);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        CALLS.set(CALLS.get() + 1);
        // SAFETY: `ptr` came from `System` with this layout.
        unsafe { System.dealloc(ptr, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn calls(work: impl FnOnce()) -> u64 {
    let before = CALLS.get();
    work();
    CALLS.get() - before
}

#[test]
fn pushing_allocates_nothing_after_the_first() {
    let (engine, session) = common::tiny();
    let sound = [0.1f32; 960];
    let push = |i: usize| {
        // SAFETY: alive; that many samples.
        let all = unsafe {
            [
                visavis_session_push_agent_audio(session, sound.as_ptr(), sound.len(), 48_000),
                visavis_session_push_user_audio(session, sound.as_ptr(), i, 16_000),
                visavis_session_push_user_head(session, 0.0, 1.6, 1.5, i as f64 * 0.01),
                visavis_session_finish_audio(session, 0),
                visavis_session_clear_audio(session, 1),
                visavis_session_push_sound(session, 7, sound.as_ptr(), i, 48_000, 1.0, 1.0, -2.0),
                visavis_session_end_sound(session, 8),
                visavis_session_push_ears(session, sound.as_ptr(), sound.as_ptr(), i, 48_000),
                visavis_session_end_ears(session),
                visavis_session_set_sensitivity(session, 1.0),
                visavis_session_set_gaze(session, 0.5),
                visavis_session_set_sampler(session, VisavisSamplerKind::Midpoint as i32, 1),
                visavis_session_set_budget(session, 50.0),
                visavis_session_report_block_time(session, 1.0),
            ]
        };
        assert_eq!(all, [VisavisStatus::Ok; 14]);
    };
    assert!(calls(|| push(1)) > 0, "the first makes resamplers, and the allocator counts");
    assert_eq!(calls(|| (1..500).for_each(push)), 0);
    // SAFETY: made above, not freed.
    unsafe {
        visavis_session_free(session);
        visavis_engine_free(engine);
    }
}
