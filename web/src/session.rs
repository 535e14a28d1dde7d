//! Sessions: one conversation.

use crate::frames::Block;
use crate::status::{refuse, status, tell};
use crate::{engine, options, slice, stats};
use visavis::glam::{Quat, Vec3};
use visavis::{Engine, Result, Session, Speaker, VoiceInput};

/// One conversation with one user, and its last block.
pub struct Conversation {
    session: Session,
    block: Block,
}

/// Runs `body` on a session.
///
/// # Safety
/// It is alive, and nobody else is inside it: a module has one thread.
unsafe fn with(session: *mut Conversation, body: impl FnOnce(&mut Session) -> Result<()>) -> i32 {
    // SAFETY: the caller's promise.
    status(body(unsafe { &mut (*session).session }))
}

/// Runs `body` on a voice (0 the agent's, 1 the user's).
///
/// # Safety
/// As [`with`].
unsafe fn with_voice(session: *mut Conversation, voice: i32, body: impl FnOnce(VoiceInput) -> Result<()>) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { with(session, |s| body(s.voice_input(Speaker::try_from(voice)?))) }
}

/// Starts a session with options in JSON (`options.rs`); null is an error, whose status goes to
/// `status`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_new(
    engine: *const Engine,
    json: *const u8,
    bytes: usize,
    status: *mut i32,
) -> *mut Conversation {
    // SAFETY: the chapter on ownership, twice.
    let (engine, json) = unsafe { (engine::shared(engine), slice(json, bytes)) };
    let joints = engine.rig().len();
    let (made, outcome) = match options::parse(json).and_then(|options| engine.session(options)) {
        Ok(session) => (Box::into_raw(Box::new(Conversation { session, block: Block::new(joints) })), 0),
        Err(error) => (std::ptr::null_mut(), refuse(&error)),
    };
    // SAFETY: room for a number, by the chapter on ownership.
    unsafe { status.write(outcome) };
    made
}

/// Frees a session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_free(session: *mut Conversation) {
    // SAFETY: made by `visavis_session_new`, not freed before.
    drop(unsafe { Box::from_raw(session) });
}

/// Appends to a voice (0 the agent's, 1 the user's): mono samples, full scale 1, 8000 to 192000 Hz.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_push_voice(
    session: *mut Conversation,
    voice: i32,
    samples: *const f32,
    count: usize,
    rate: u32,
) -> i32 {
    // SAFETY: the chapter on ownership, twice.
    unsafe { with_voice(session, voice, |v| v.push(slice(samples, count), rate)) }
}

/// Ends an utterance: the last milliseconds, which wait in the resampler, come out.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_finish_voice(session: *mut Conversation, voice: i32) -> i32 {
    let finish = |v: VoiceInput| {
        v.finish();
        Ok(())
    };
    // SAFETY: the chapter on ownership.
    unsafe { with_voice(session, voice, finish) }
}

/// Drops all of a voice that has not been used: an utterance is broken off.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_clear_voice(session: *mut Conversation, voice: i32) -> i32 {
    let clear = |v: VoiceInput| {
        v.clear();
        Ok(())
    };
    // SAFETY: the chapter on ownership.
    unsafe { with_voice(session, voice, clear) }
}

/// Makes a voice present, silent until something is pushed, or absent until the next push.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_set_voice_present(session: *mut Conversation, voice: i32, present: i32) -> i32 {
    let set = |v: VoiceInput| {
        v.set_present(present != 0);
        Ok(())
    };
    // SAFETY: the chapter on ownership.
    unsafe { with_voice(session, voice, set) }
}

/// Tells where the user's head is: midpoint of the eyes, world metres, at `time` seconds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_push_head(session: *mut Conversation, x: f32, y: f32, z: f32, time: f64) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.push_user_head(Vec3::new(x, y, z), time)) }
}

/// As [`visavis_push_head`], with the head's rotation: a quaternion of about unit length in the world,
/// identity where the user faces +Z.
#[allow(clippy::too_many_arguments, reason = "a module takes numbers alone")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_push_pose(
    session: *mut Conversation,
    x: f32,
    y: f32,
    z: f32,
    qx: f32,
    qy: f32,
    qz: f32,
    qw: f32,
    time: f64,
) -> i32 {
    let rotation = Quat::from_xyzw(qx, qy, qz, qw);
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.push_user_pose(Vec3::new(x, y, z), Some(rotation), time)) }
}

/// Pushes a piece of what sound source `id` gives off: mono samples, pascals as they are 1 m from
/// it, 8000 to 192000 Hz; it is at (x, y, z) from now on, world metres.
#[allow(clippy::too_many_arguments, reason = "a module takes numbers alone")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_push_sound(
    session: *mut Conversation,
    id: u32,
    samples: *const f32,
    count: usize,
    rate: u32,
    x: f32,
    y: f32,
    z: f32,
) -> i32 {
    // SAFETY: the chapter on ownership, twice.
    unsafe { with(session, |s| s.push_sound(id, slice(samples, count), rate, Vec3::new(x, y, z))) }
}

/// Ends a sound source at once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_end_sound(session: *mut Conversation, id: u32) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.end_sound(id)) }
}

/// Pushes a piece of what two microphones at the agent's ears hear, pascals: `count` samples of the
/// left one, then as many of the right one, 8000 to 192000 Hz.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_push_ears(
    session: *mut Conversation,
    ears: *const f32,
    count: usize,
    rate: u32,
) -> i32 {
    // SAFETY: the chapter on ownership, twice.
    unsafe {
        with(session, |s| {
            let (left, right) = slice(ears, 2 * count).split_at(count);
            s.push_ears(left, right, rate)
        })
    }
}

/// Ends what the ears brought at once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_end_ears(session: *mut Conversation) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.end_ears()) }
}

/// Where the last block took what stands out among the sounds to be: 1, and x, y, z in world metres
/// at `place`; 0, and `place` as it was, while nothing is known.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_heard_place(session: *const Conversation, place: *mut f32) -> i32 {
    // SAFETY: the chapter on ownership.
    let Some(heard) = unsafe { &*session }.session.heard_place() else { return 0 };
    // SAFETY: room for three numbers, by the chapter on ownership.
    unsafe { place.cast::<[f32; 3]>().write(heard.to_array()) };
    1
}

/// Sets how much the agent minds sounds in the room: -1 dull, 0 neutral, 1 sensitive, up to 1.5
/// either way.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_set_sensitivity(session: *mut Conversation, sensitivity: f32) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.set_sensitivity(sensitivity)) }
}

/// Sets the gaze target, -1 to 1; NaN leaves the gaze free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_set_gaze(session: *mut Conversation, target: f32) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.set_gaze((!target.is_nan()).then_some(target))) }
}

/// Sets the sampler of the coming blocks by its name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_set_sampler(session: *mut Conversation, name: *const u8, bytes: usize) -> i32 {
    // SAFETY: the chapter on ownership.
    let name = String::from_utf8_lossy(unsafe { slice(name, bytes) });
    // SAFETY: the same.
    unsafe { with(session, |s| s.set_sampler(name.parse()?)) }
}

/// Sets the milliseconds that a block may take, 1 to 133.3; 0: the session's sampler, always.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_set_budget(session: *mut Conversation, milliseconds: f32) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.set_governor(visavis::Governor::within(milliseconds))) }
}

/// Gives a session with a budget an engine of the kind `dram` to step down to instead of holding
/// its pose; the engine may be freed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_set_fallback(session: *mut Conversation, engine: *const Engine) -> i32 {
    // SAFETY: the chapter on ownership, twice.
    unsafe { with(session, |s| s.set_fallback(&engine::shared(engine))) }
}

/// Tells how long the last block took by the caller's clock, milliseconds, in place of what the
/// session measured.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_report_block_time(session: *mut Conversation, milliseconds: f64) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, |s| s.report_block_time(milliseconds)) }
}

/// Starts anew, as if just made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_reset(session: *mut Conversation) -> i32 {
    // SAFETY: the chapter on ownership.
    unsafe { with(session, Session::reset) }
}

/// Session time at which the next block is due, seconds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_next_due(session: *const Conversation) -> f64 {
    // SAFETY: the chapter on ownership.
    unsafe { &*session }.session.next_due()
}

/// Computes the next block if it is due at `now`: 1, and the block lies at [`visavis_numbers`] and
/// [`visavis_joints`]; 0 if none is due; minus the status of an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_poll(session: *mut Conversation, now: f64) -> i32 {
    // SAFETY: the chapter on ownership.
    let conversation = unsafe { &mut *session };
    match conversation.session.poll(now) {
        Ok(Some(frames)) => {
            conversation.block.fill(frames);
            1
        }
        Ok(None) => 0,
        Err(error) => -refuse(&error),
    }
}

/// Numbers of the last block's frames, f64.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_numbers(session: *const Conversation) -> *const f64 {
    // SAFETY: the chapter on ownership.
    unsafe { &*session }.block.numbers().as_ptr()
}

/// Joints of the last block's frames, f32.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_joints(session: *const Conversation) -> *const f32 {
    // SAFETY: the chapter on ownership.
    unsafe { &*session }.block.joints().as_ptr()
}

/// How much each joint of the last block's frames follows the user, 0 to 1, f32: as many for a frame as
/// the rig has joints, or none at all ([`visavis_shares_length`]).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_shares(session: *const Conversation) -> *const f32 {
    // SAFETY: the chapter on ownership.
    unsafe { &*session }.block.shares().as_ptr()
}

/// Numbers at [`visavis_shares`]: 0 where a bundle made the block that does not tell them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_shares_length(session: *const Conversation) -> usize {
    // SAFETY: the chapter on ownership.
    unsafe { &*session }.block.shares().len()
}

/// Tells the session's statistics as JSON.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_stats(session: *const Conversation) {
    // SAFETY: the chapter on ownership.
    tell(stats::json(&unsafe { &*session }.session.stats()));
}
