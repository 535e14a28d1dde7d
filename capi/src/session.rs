//! Sessions: one conversation.

use crate::VISAVIS_BLOCK_FRAMES;
use crate::engine::VisavisEngine;
use crate::frames::{VisavisFrame, VisavisJoint, joints_of};
use crate::options::{VisavisSessionOptions, sampler};
use crate::status::{Failure, Outcome, VisavisStatus, guard};
use crate::structs::{borrow, place, room, slice};
use std::sync::TryLockError;
use visavis::glam::Vec3;
use visavis::{Session, SharedSession, Speaker, VoiceInput};

/// One conversation with one user.
pub struct VisavisSession {
    shared: SharedSession,
}

/// One of the two voices.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisavisVoice {
    /// The agent's own, usually known ahead.
    Agent = 0,
    /// The user's, as the microphone hears it.
    User = 1,
}

/// Runs `body` on what goes around a session: inputs and controls, whoever is inside it.
///
/// # Safety
/// `session`, if neither null nor misaligned, is alive.
unsafe fn around(session: *const VisavisSession, body: impl FnOnce(&SharedSession) -> Outcome) -> VisavisStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let session = unsafe { borrow(session, "session") }?;
        if session.shared.is_poisoned() {
            return Err(poisoned());
        }
        body(&session.shared)
    })
}

/// Runs `body` on a session that nobody else is inside.
///
/// # Safety
/// As [`around`].
pub(crate) unsafe fn with(session: *const VisavisSession, body: impl FnOnce(&mut Session) -> Outcome) -> VisavisStatus {
    let inside = |shared: &SharedSession| match shared.try_lock() {
        Ok(mut session) => body(&mut session),
        Err(TryLockError::WouldBlock) => {
            let message = "another thread is inside this session: poll, reset and ask from one at a time";
            Err(Failure::new(VisavisStatus::Busy, message))
        }
        Err(TryLockError::Poisoned(_)) => Err(poisoned()),
    };
    // SAFETY: the caller's promise.
    unsafe { around(session, inside) }
}

fn poisoned() -> Failure {
    Failure::new(VisavisStatus::Panic, "this session met an internal fault before: free it and make another")
}

/// Runs `body` on a voice's input.
///
/// # Safety
/// As [`around`].
unsafe fn voice(session: *const VisavisSession, which: i32, body: impl FnOnce(&VoiceInput)) -> VisavisStatus {
    let of_voice = |shared: &SharedSession| {
        body(shared.voice(Speaker::try_from(which)?));
        Ok(())
    };
    // SAFETY: the caller's promise.
    unsafe { around(session, of_voice) }
}

/// Appends to a voice.
///
/// # Safety
/// As [`around`]; `samples`, if neither null nor misaligned, are `count`, which nobody writes to
/// meanwhile.
unsafe fn push(
    session: *const VisavisSession,
    speaker: Speaker,
    samples: *const f32,
    count: usize,
    rate: u32,
) -> VisavisStatus {
    // SAFETY: the caller's promise, twice.
    unsafe { around(session, |shared| Ok(shared.voice(speaker).push(slice(samples, count, "samples")?, rate)?)) }
}

/// Starts a session on `engine`; `options` may be NULL for the defaults. All its memory is taken
/// here.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_new(
    engine: *const VisavisEngine,
    options: *const VisavisSessionOptions,
    session: *mut *mut VisavisSession,
) -> VisavisStatus {
    guard(|| {
        // SAFETY: the header's promise, here and below.
        let out = unsafe { place(session, "session") }?.write(std::ptr::null_mut());
        // SAFETY: as above.
        let engine = unsafe { borrow(engine, "engine") }?;
        // SAFETY: as above.
        let options = unsafe { VisavisSessionOptions::options(options) }?;
        let made = VisavisSession { shared: SharedSession::new(engine.engine.session(options)?) };
        *out = Box::into_raw(Box::new(made));
        Ok(())
    })
}

/// Frees a session.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_free(session: *mut VisavisSession) {
    guard(|| {
        if !session.is_null() {
            // SAFETY: made by `visavis_session_new` and not freed before, by the ownership chapter.
            drop(unsafe { Box::from_raw(session) });
        }
        Ok(())
    });
}

/// Appends to the agent's own voice: `count` mono samples, full scale 1, of `rate` Hz (8000 to
/// 192000), up to a minute ahead of time (voice_ahead of the options). More is dropped and counted. Sound that has not come when
/// a block is computed is silence there, is counted, and is heard later. A voice that was never
/// pushed is absent, which is not the same as silent. Samples that are not finite become silence,
/// are counted, and make the status VISAVIS_STATUS_AUDIO; all others are taken. From any thread,
/// see THREADS.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_push_agent_audio(
    session: *mut VisavisSession,
    samples: *const f32,
    count: usize,
    rate: u32,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { push(session, Speaker::Agent, samples, count, rate) }
}

/// Appends to the user's voice, as visavis_session_push_agent_audio.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_push_user_audio(
    session: *mut VisavisSession,
    samples: *const f32,
    count: usize,
    rate: u32,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { push(session, Speaker::User, samples, count, rate) }
}

/// Ends an utterance of a voice (a visavis_voice): the last milliseconds, which wait in the
/// resampler, come out. Optional.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_finish_audio(session: *mut VisavisSession, which: i32) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { voice(session, which, VoiceInput::finish) }
}

/// Drops all sound of a voice (a visavis_voice) that has not been used, as when an utterance is
/// broken off.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_clear_audio(session: *mut VisavisSession, which: i32) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { voice(session, which, VoiceInput::clear) }
}

/// Makes a voice (a visavis_voice) present, silent until something is pushed (`present` not 0), or
/// absent until the next push (0).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_audio_present(
    session: *mut VisavisSession,
    which: i32,
    present: i32,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { voice(session, which, |voice| voice.set_present(present != 0)) }
}

/// Tells where the user's head is (midpoint of the eyes), world metres, at `time` seconds of
/// session time. Any rate; positions are put in order by time. Those that are late, not finite or
/// impossible are ignored and counted (visavis_stats). From any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_push_user_head(
    session: *mut VisavisSession,
    x: f32,
    y: f32,
    z: f32,
    time: f64,
) -> VisavisStatus {
    let tell = |shared: &SharedSession| {
        shared.head().push(Vec3::new(x, y, z), time);
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { around(session, tell) }
}

/// As visavis_session_push_user_head, with the head's rotation: a quaternion of about unit length
/// in the world, identity where the user faces +Z. Bundles of the kind `dram` see where the face
/// points and how the head nods; the others make the same motion with and without.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "numbers of a pose, one by one")]
pub unsafe extern "C" fn visavis_session_push_user_pose(
    session: *mut VisavisSession,
    x: f32,
    y: f32,
    z: f32,
    qx: f32,
    qy: f32,
    qz: f32,
    qw: f32,
    time: f64,
) -> VisavisStatus {
    let tell = |shared: &SharedSession| {
        shared.head().push_numbers([x, y, z, qx, qy, qz, qw], time);
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { around(session, tell) }
}

/// Pushes a piece of what sound source `id` in the room gives off: `count` mono samples of `rate` Hz
/// (8000 to 192000), pascals as they are 1 m from it (RMS 1 is 94 dB SPL); (x, y, z) is where it is
/// from now on, world metres.
///
/// The first piece of a source, and the first after it ran dry, sounds from the start of the next
/// block on; further pieces follow it without a gap, up to ten seconds ahead. No samples move a
/// source that sounds. Sixteen sources sound at once: one more takes the place of the quietest at
/// the agent's head, if it is louder. What is dropped is counted (visavis_stats).
///
/// VISAVIS_STATUS_ARGUMENT where the bundle has no hearing (visavis_engine_has_hearing), and for a
/// place that is not finite or beyond 2000 km; the sound of a source that has a place is taken all
/// the same. VISAVIS_STATUS_AUDIO for a rate out of range, of which nothing is taken, and for
/// samples that are not finite, in whose place there is silence. From any thread, one at a time for
/// a source. Since interface 1.3.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments, reason = "a place's numbers, one by one")]
pub unsafe extern "C" fn visavis_session_push_sound(
    session: *mut VisavisSession,
    id: u32,
    samples: *const f32,
    count: usize,
    rate: u32,
    x: f32,
    y: f32,
    z: f32,
) -> VisavisStatus {
    let push = |shared: &SharedSession| {
        // SAFETY: the header's promise.
        let samples = unsafe { slice(samples, count, "samples") }?;
        Ok(shared.sounds().push(id, samples, rate, Vec3::new(x, y, z))?)
    };
    // SAFETY: the header's promise.
    unsafe { around(session, push) }
}

/// Ends sound source `id` at once: what no block has heard of it is dropped. Without effect where
/// it does not sound; VISAVIS_STATUS_ARGUMENT where the bundle has no hearing. From any thread.
/// Since interface 1.3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_end_sound(session: *mut VisavisSession, id: u32) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |shared| Ok(shared.sounds().end(id)?)) }
}

/// Pushes a piece of what two microphones at the agent's ears hear, pascals: `count` samples of each,
/// of `rate` Hz (8000 to 192000). For hosts that do not know where sounds are: the direction is
/// estimated, as the agent's head turns; distance and height are not.
///
/// The first piece, and the first after they ran dry, is heard from the start of the next block on;
/// further pieces follow without a gap, up to ten seconds ahead (more is dropped and counted). No
/// samples change nothing.
///
/// VISAVIS_STATUS_ARGUMENT where the bundle has no hearing; VISAVIS_STATUS_AUDIO for a rate out of
/// range, of which nothing is taken, and for samples that are not finite, in whose place there is
/// silence. From any thread, one at a time: what comes from another meanwhile is dropped and
/// counted. Since interface 1.3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_push_ears(
    session: *mut VisavisSession,
    left: *const f32,
    right: *const f32,
    count: usize,
    rate: u32,
) -> VisavisStatus {
    let push = |shared: &SharedSession| {
        // SAFETY: the header's promise, twice.
        let (left, right) = unsafe { (slice(left, count, "left")?, slice(right, count, "right")?) };
        Ok(shared.sounds().push_ears(left, right, rate)?)
    };
    // SAFETY: the header's promise.
    unsafe { around(session, push) }
}

/// Ends what visavis_session_push_ears brought at once: what no block has heard of it is dropped.
/// VISAVIS_STATUS_ARGUMENT where the bundle has no hearing. From any thread. Since interface 1.3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_end_ears(session: *mut VisavisSession) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |shared| Ok(shared.sounds().end_ears()?)) }
}

/// Sets how much the agent minds sounds in the room from the next block on: -1 dull, 0 neutral, 1
/// sensitive, numbers between and up to 1.5 either way. Since interface 1.3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_sensitivity(
    session: *mut VisavisSession,
    sensitivity: f32,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().set_sensitivity(sensitivity)?)) }
}

/// Sets the gaze target from the next block on, -1 to 1: 0 is averted, 1 sustained eye
/// contact.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_gaze(session: *mut VisavisSession, target: f32) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().set_gaze(Some(target))?)) }
}

/// Leaves the gaze to the model from the next block on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_natural_gaze(session: *mut VisavisSession) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().set_gaze(None)?)) }
}

/// Sets the guidance weights, 0 to 20: of the conditioning as a whole (1 is none), and of the gaze
/// target.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_guidance(
    session: *mut VisavisSession,
    weight: f32,
    gaze: f32,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().set_guidance(weight, gaze)?)) }
}

/// Sets the sampler from the next block on; `kind` is a visavis_sampler_kind.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_sampler(
    session: *mut VisavisSession,
    kind: i32,
    steps: u32,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().set_sampler(sampler(kind, steps)?)?)) }
}

/// Sets the milliseconds that a block may take, 1 to 133.3, from the next block on: a governor then
/// chooses the sampler of each block, the session's at best. 0 pins the session's sampler.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_budget(session: *mut VisavisSession, milliseconds: f32) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().set_budget(milliseconds)?)) }
}

/// Gives a session with a budget an engine of the kind `dram`, of the same rig and delays, to step
/// down to: where blocks of even the cheapest sampler come late three times in a row, that engine
/// makes the motion, instead of a pose being held, through a cross-fade both ways.
/// visavis_session_dyadic tells of its frames, governor_fallback_blocks counts its blocks. Takes
/// memory; a reset keeps it; the engine may be freed afterwards. One thread's at a time, as
/// visavis_session_poll. Since interface 1.2.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_set_fallback(
    session: *mut VisavisSession,
    engine: *const VisavisEngine,
) -> VisavisStatus {
    let set = |s: &mut Session| {
        // SAFETY: the header's promise.
        let fallback = unsafe { borrow(engine, "engine") }?;
        Ok(s.set_fallback(&fallback.engine)?)
    };
    // SAFETY: the header's promise.
    unsafe { with(session, set) }
}

/// Tells the governor how long the last block took by the caller's clock, in place of what the
/// session measured: for callers whose deadline covers more than visavis_session_poll.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_report_block_time(
    session: *mut VisavisSession,
    milliseconds: f64,
) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { around(session, |s| Ok(s.controls().report_block_time(milliseconds)?)) }
}

/// Computes the next block if it is due at `now` (session time, seconds, never running backwards).
/// Call it until `*frame_count` is 0: a caller that comes late gets all blocks that it missed.
///
/// When a block is due, `*frame_count` becomes 4, and `frames[0..4]` and `joints` are filled; the
/// joints of frame `i` start at `joints[i * visavis_engine_joint_count]`. `frame_size` is
/// sizeof(visavis_frame); `joint_capacity`, in joints, must be at least 4 times the joint count.
/// `joints` may be NULL with capacity 0 if only the frames are wanted. Nothing is allocated.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_poll(
    session: *mut VisavisSession,
    now: f64,
    frames: *mut VisavisFrame,
    frame_size: usize,
    joints: *mut VisavisJoint,
    joint_capacity: usize,
    frame_count: *mut u32,
) -> VisavisStatus {
    let poll = |s: &mut Session| {
        // SAFETY: the header's promise.
        let count = unsafe { place(frame_count, "frame_count") }?.write(0);
        let per_frame = s.engine().rig().joints.len();
        let all = VISAVIS_BLOCK_FRAMES * per_frame;
        if joint_capacity < all && !(joints.is_null() && joint_capacity == 0) {
            return Err(Failure::argument(format!("joint_capacity is {joint_capacity}: a block has {all} joints")));
        }
        VisavisFrame::check_size(frame_size)?;
        crate::structs::check(frames, "frames")?;
        // SAFETY: the header's promise.
        let room_for_joints = unsafe { room(joints, if joints.is_null() { 0 } else { all }, "joints") }?;
        let Some(made) = s.poll(now)? else { return Ok(()) };
        let mut joints_left = room_for_joints.iter_mut();
        for (i, frame) in made.iter().enumerate() {
            // SAFETY: the header's promise: four frames of `frame_size` bytes.
            unsafe { VisavisFrame::of(frame).write(frames.cast::<u8>().add(i * frame_size), frame_size) };
            joints_of(frame).zip(joints_left.by_ref()).for_each(|(joint, to)| _ = to.write(joint));
        }
        *count = made.len() as u32;
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { with(session, poll) }
}

/// How much each joint follows the user rather than the agent's own voice and habit in the last
/// block's frames, 0 to 1: the read-out of bundles of the kind `dram`. `*count` becomes 4 times the
/// joint count, the shares of frame `i` starting at `shares[i * visavis_engine_joint_count]`, or 0
/// before the first block and where another bundle made the last one. `capacity` is the room in
/// `shares`; too little is refused.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_dyadic(
    session: *const VisavisSession,
    shares: *mut f32,
    capacity: usize,
    count: *mut usize,
) -> VisavisStatus {
    let read = |s: &mut Session| {
        // SAFETY: the header's promise, twice.
        let (shares, count) = unsafe { (room(shares, capacity, "shares")?, place(count, "count")?.write(0)) };
        let all: usize = s.frames().into_iter().flatten().map(|frame| frame.dyadic.len()).sum();
        if capacity < all {
            return Err(Failure::argument(format!("capacity is {capacity}: a block has {all} shares")));
        }
        let made = s.frames().into_iter().flatten().flat_map(|frame| &frame.dyadic);
        shares.iter_mut().zip(made).for_each(|(to, share)| _ = to.write(*share));
        *count = all;
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { with(session, read) }
}

/// Where the last block took what stands out among the sounds to be, into `position[3]`, world
/// metres: the place of a source, or the direction that was estimated of what
/// visavis_session_push_ears brought, 2 m away and 1.5 m over the floor. `*known` becomes 1, or 0
/// and the position stays as it was, while nothing is known. Since interface 1.3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_heard_place(
    session: *const VisavisSession,
    position: *mut f32,
    known: *mut i32,
) -> VisavisStatus {
    let read = |s: &mut Session| {
        // SAFETY: the header's promise, twice.
        let (position, known) = unsafe { (room(position, 3, "position")?, place(known, "known")?) };
        let heard = s.heard_place();
        if let Some(heard) = heard {
            position.iter_mut().zip(heard.to_array()).for_each(|(to, v)| _ = to.write(v));
        }
        known.write(i32::from(heard.is_some()));
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { with(session, read) }
}

/// Session time at which the next block is due, seconds, into `time`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_next_due(session: *const VisavisSession, time: *mut f64) -> VisavisStatus {
    let due = |s: &mut Session| {
        // SAFETY: the header's promise.
        unsafe { place(time, "time") }?.write(s.next_due());
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { with(session, due) }
}

/// Starts anew with the options of now; session time is 0 again. Same inputs, same bits. What was
/// pushed before is dropped.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_reset(session: *mut VisavisSession) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { with(session, |s| Ok(s.reset()?)) }
}

/// Computes `blocks` blocks for nothing and starts anew, so that memory and CPU are warm when the
/// first block is due.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_warm_up(session: *mut VisavisSession, blocks: u32) -> VisavisStatus {
    // SAFETY: the header's promise.
    unsafe { with(session, |s| Ok(s.warm_up(blocks)?)) }
}

/// Kernel ids of the threads that the session owns and computes on, for performance hints: `*count`
/// of them, the first `capacity` into `ids`. The thread that polls computes too
/// (visavis_current_thread_id).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_worker_thread_ids(
    session: *const VisavisSession,
    ids: *mut u32,
    capacity: usize,
    count: *mut usize,
) -> VisavisStatus {
    let list = |s: &mut Session| {
        // SAFETY: the header's promise, twice.
        let (ids, count) = unsafe { (room(ids, capacity, "ids")?, place(count, "count")?) };
        ids.iter_mut().zip(s.worker_thread_ids()).for_each(|(to, id)| _ = to.write(id));
        count.write(s.worker_thread_ids().count());
        Ok(())
    };
    // SAFETY: the header's promise.
    unsafe { with(session, list) }
}
