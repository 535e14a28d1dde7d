//! Several threads in one session, by way of the C functions: two that push from one buffer and set
//! what there is to set, and one that polls. Also under the sanitizers (`tests/sanitize.sh`).

mod common;

use std::ptr::null_mut;
use visavis_c::*;

/// A pointer that threads may share.
struct Shared<T>(*mut T);

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Shared<T> {}

// SAFETY: sessions may be pushed into from any thread; the buffer is only read.
unsafe impl<T> Send for Shared<T> {}
// SAFETY: as above.
unsafe impl<T> Sync for Shared<T> {}

#[test]
fn two_push_from_one_buffer_while_a_third_polls() {
    let (engine, session) = common::tiny();
    let mut sound = [0.1f32; 960];
    let (session, buffer) = (Shared(session), Shared(sound.as_mut_ptr()));
    std::thread::scope(|scope| {
        for thread in 0..2i32 {
            scope.spawn(move || {
                let (Shared(session), Shared(buffer)) = (session, buffer);
                for i in 0..300 {
                    // SAFETY: alive until after the scope; the buffer has that length and nobody
                    // writes to it.
                    let all = unsafe {
                        [
                            visavis_session_push_agent_audio(session, buffer, 960, 48_000),
                            visavis_session_push_user_audio(session, buffer, 960, 24_000),
                            visavis_session_push_user_head(session, 0.0, 1.6, 1.5, f64::from(2 * i + thread) * 0.01),
                            visavis_session_finish_audio(session, thread),
                            visavis_session_set_audio_present(session, 1 - thread, i32::from(i % 50 > 0)),
                            visavis_session_set_gaze(session, 0.5),
                            visavis_session_push_sound(session, 1 + thread as u32, buffer, 960, 48_000, 1.0, 1.0, -2.0),
                            visavis_session_push_sound(session, 100 + i as u32, buffer, 96, 24_000, 0.0, 1.0, 9.0),
                            visavis_session_end_sound(session, 2 - thread as u32),
                            visavis_session_push_ears(session, buffer, buffer, 960, 48_000),
                            visavis_session_end_ears(session),
                            visavis_session_set_sensitivity(session, 1.0 - thread as f32),
                            visavis_session_set_natural_gaze(session),
                            visavis_session_set_guidance(session, 1.3, 2.0),
                            visavis_session_set_sampler(session, VisavisSamplerKind::Midpoint as i32, 1),
                            visavis_session_set_budget(session, 0.0),
                            visavis_session_report_block_time(session, 1.0),
                        ]
                    };
                    assert_eq!(all, [VisavisStatus::Ok; 17]);
                }
            });
        }
        let frame = VisavisFrame {
            index: 0,
            time: 0.0,
            root_x: 0.0,
            root_z: 0.0,
            root_yaw: 0.0,
            hips: [0.0; 3],
            fit_error: 0.0,
            gaze: 0.0,
            sampler_kind: 0,
            sampler_steps: 0,
            held: 0.0,
            #[cfg(feature = "grown")]
            grown: 0,
        };
        let (mut frames, mut count) = ([frame; VISAVIS_BLOCK_FRAMES], 0);
        for k in 0..6 {
            // SAFETY: alive; room for four frames of that size.
            let status = unsafe {
                let size = size_of::<VisavisFrame>();
                visavis_session_poll(session.0, 1e6, frames.as_mut_ptr(), size, null_mut(), 0, &mut count)
            };
            assert_eq!((status, count, frames[0].index), (VisavisStatus::Ok, 4, 4 * k));
        }
    });
    // SAFETY: made above, not freed, nobody else is inside.
    unsafe {
        visavis_session_free(session.0);
        visavis_engine_free(engine);
    }
}
