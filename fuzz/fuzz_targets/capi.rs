//! The C interface under a caller that does anything: any order of calls, null and misaligned
//! pointers, sizes that lie, numbers out of range. A status comes back, never a panic, and not a
//! byte beyond what the caller offered is written. Pointers that are neither null nor misaligned
//! are sound, as the ownership chapter of the header asks.
#![no_main]

use arbitrary::{Arbitrary, Unstructured};
use libfuzzer_sys::fuzz_target;
use std::cell::Cell;
use std::ffi::CStr;
use std::ptr::{null, null_mut};
use visavis_c::*;
use visavis_fuzz::{DRAM, small_bundle};

#[derive(Debug, Arbitrary)]
enum Call {
    New { options: [u8; 104], size: u8, null: bool },
    Defaults { size: u8 },
    Free,
    Sound { agent: bool, len: u16, rate: u32, value: f32, pointer: u8 },
    GoodSound { agent: bool, len: u16 },
    Finish(i32),
    Clear(i32),
    Present(i8, i32),
    Head([f32; 3], f64),
    Gaze(f32),
    NaturalGaze,
    Guidance(f32, f32),
    Sampler(i8, u8),
    /// An engine that is no fallback, or one of another rig.
    Fallback { light: bool, pointer: u8 },
    Poll { now: f64, frame_size: u16, joints: u16, pointers: u8 },
    Due { pointers: u8 },
    Reset,
    WarmUp(bool),
    ThreadIds { capacity: u8, pointers: u8 },
    Stats { size: u16, null: bool },
    Joint { joint: u32, pointers: u8 },
    OpenXr(u8, i32),
    Memory { from: u16, len: u16, null: bool },
    Path([u8; 12]),
    Descriptor(u64, u64),
    Abi(u32),
    /// A sound in the room: source, length, rate, value, place, pointers.
    Source(u8, u16, u32, f32, [f32; 3], u8),
    /// The same at a rate that is allowed, within some metres.
    GoodSource { id: u8, len: u16, place: [i8; 3] },
    EndSource(u8),
    /// What a host's ears hear: length, rate, values, pointers.
    Ears(u16, u32, [f32; 2], u8),
    GoodEars { len: u16, ahead: u8 },
    EndEars,
    Sensitivity(f32),
    HeardPlace { pointers: u8 },
}

/// What no function may touch.
const CANARY: u8 = 0xA5;

thread_local! {
    /// One engine and one session for all executions: making them takes longer than using them.
    static SHARED: Cell<Option<(*mut VisavisEngine, *mut VisavisSession)>> = const { Cell::new(None) };
}

fn shared() -> (*mut VisavisEngine, *mut VisavisSession) {
    SHARED.get().unwrap_or_else(|| {
        let (bytes, mut engine, mut session) = (small_bundle(), null_mut(), null_mut());
        // SAFETY: a slice, and places for pointers; an engine that lives on.
        unsafe {
            assert_eq!(visavis_engine_from_memory(bytes.as_ptr(), bytes.len(), &mut engine), VisavisStatus::Ok);
            assert_eq!(visavis_session_new(engine, null(), &mut session), VisavisStatus::Ok);
        }
        SHARED.set(Some((engine, session)));
        (engine, session)
    })
}

/// An engine of the featherweight tier.
fn light() -> *mut VisavisEngine {
    thread_local! {
        static LIGHT: Cell<*mut VisavisEngine> = const { Cell::new(null_mut()) };
    }
    if LIGHT.get().is_null() {
        let mut engine = null_mut();
        // SAFETY: a slice, and a place for a pointer.
        let status = unsafe { visavis_engine_from_memory(DRAM[0].as_ptr(), DRAM[0].len(), &mut engine) };
        assert_eq!(status, VisavisStatus::Ok);
        LIGHT.set(engine);
    }
    LIGHT.get()
}

fuzz_target!(|data: &[u8]| {
    let mut u = Unstructured::new(data);
    let (engine, kept) = shared();
    // SAFETY: alive.
    unsafe {
        assert_eq!(visavis_session_set_natural_gaze(kept), VisavisStatus::Ok);
        assert_eq!(visavis_session_set_guidance(kept, 1.3, 2.5), VisavisStatus::Ok);
        assert_eq!(visavis_session_set_sampler(kept, VisavisSamplerKind::Single as i32, 1), VisavisStatus::Ok);
        assert_eq!(visavis_session_reset(kept), VisavisStatus::Ok);
    }
    let mut caller = Caller { engine, kept, own: null_mut(), made: 0, blocks: 0 };
    while let Ok(call) = Call::arbitrary(&mut u) {
        if u.is_empty() || caller.blocks >= 2 {
            break;
        }
        let status = caller.make(call);
        // SAFETY: never null, alive until the next call.
        let text = unsafe { CStr::from_ptr(visavis_last_error()) };
        assert_ne!(status, VisavisStatus::Panic, "{text:?}");
        assert!(status == VisavisStatus::Ok || !text.is_empty(), "{status:?} without a word");
    }
    // SAFETY: null, or made below and not freed.
    unsafe { visavis_session_free(caller.own) };
});

struct Caller {
    engine: *mut VisavisEngine,
    /// The session of all executions.
    kept: *mut VisavisSession,
    /// One that this execution made.
    own: *mut VisavisSession,
    made: u32,
    blocks: u32,
}

/// `good`, or null, or a misaligned one, as two bits of `how` say.
fn pointer<T>(good: *mut T, how: u8, bit: u32) -> *mut T {
    match how >> (2 * bit) & 3 {
        0 | 1 => good,
        2 => null_mut(),
        _ => good.cast::<u8>().wrapping_add(1).cast(),
    }
}

impl Caller {
    fn session(&self) -> *mut VisavisSession {
        if self.own.is_null() { self.kept } else { self.own }
    }

    /// Makes the call; functions without a status count as done.
    fn make(&mut self, call: Call) -> VisavisStatus {
        let session = self.session();
        let mut sound = [0.0f32; 4096];
        // SAFETY: each pointer is null, misaligned or sound; sizes that are promised are there.
        unsafe {
            match call {
                Call::New { options, size, null } if self.made < 1 => {
                    self.made += 1;
                    visavis_session_free(self.own);
                    self.own = null_mut();
                    let mut given = [0u64; 16];
                    let bytes = given.as_mut_ptr().cast::<u8>();
                    bytes.copy_from(options.as_ptr(), options.len());
                    // More than what is there is not promised.
                    bytes.cast::<u32>().write(u32::from(size).min(128));
                    // Mostly room for sound that is allowed.
                    if options[96] % 4 > 0 {
                        given[12] = 60f64.to_bits();
                    }
                    let bytes = given.as_mut_ptr().cast::<u8>();
                    // Not two threads: starting one would be all that takes time.
                    bytes.cast::<u32>().add(1).write([1, 1, 0, 3][usize::from(options[4] % 4)]);
                    let options = if null { std::ptr::null() } else { given.as_ptr().cast() };
                    visavis_session_new(self.engine, options, &mut self.own)
                }
                Call::New { .. } => {
                    let mut none = self.own;
                    let status = visavis_session_new(null(), null(), &mut none);
                    assert!(none.is_null() && status == VisavisStatus::Argument);
                    status
                }
                Call::Defaults { size } => {
                    let mut room = [u64::from_ne_bytes([CANARY; 8]); 32];
                    let status = visavis_session_options_init(room.as_mut_ptr().cast(), usize::from(size));
                    intact(&room, usize::from(size));
                    status
                }
                Call::Free => {
                    visavis_session_free(self.own);
                    self.own = null_mut();
                    visavis_session_free(null_mut());
                    visavis_engine_free(null_mut());
                    VisavisStatus::Ok
                }
                Call::Sound { agent, len, rate, value, pointer: how } => {
                    sound.fill(value);
                    // A length that lies is told only with a pointer that cannot be used.
                    let sound_pointer = how & 3 < 2;
                    let count = if sound_pointer { usize::from(len) % sound.len() } else { usize::from(len) << 48 };
                    let data = pointer(sound.as_mut_ptr(), how, 0);
                    let push = if agent { visavis_session_push_agent_audio } else { visavis_session_push_user_audio };
                    push(pointer(session, how, 1), data, count, rate)
                }
                Call::GoodSound { agent, len } => {
                    sound.iter_mut().enumerate().for_each(|(i, s)| *s = (i % 100) as f32 / 200.0);
                    let push = if agent { visavis_session_push_agent_audio } else { visavis_session_push_user_audio };
                    let status = push(session, sound.as_ptr(), usize::from(len) % sound.len(), 24_000);
                    assert_eq!(status, VisavisStatus::Ok);
                    status
                }
                Call::Finish(voice) => visavis_session_finish_audio(session, voice % 4),
                Call::Clear(voice) => visavis_session_clear_audio(session, voice % 4),
                Call::Present(voice, present) => {
                    visavis_session_set_audio_present(session, i32::from(voice % 4), present)
                }
                Call::Head([x, y, z], time) => visavis_session_push_user_head(session, x, y, z, time),
                Call::Gaze(target) => visavis_session_set_gaze(session, target),
                Call::NaturalGaze => visavis_session_set_natural_gaze(session),
                Call::Guidance(weight, gaze) => visavis_session_set_guidance(session, weight, gaze),
                Call::Sampler(kind, steps) => {
                    visavis_session_set_sampler(session, i32::from(kind % 4), u32::from(steps))
                }
                Call::Fallback { light, pointer: how } => {
                    let other = if light { self::light() } else { self.engine };
                    let status = visavis_session_set_fallback(session, pointer(other, how, 0));
                    assert_eq!(status, VisavisStatus::Argument);
                    status
                }
                Call::Poll { now, frame_size, joints, pointers } => self.poll(now, frame_size, joints, pointers),
                Call::Due { pointers } => {
                    let mut time = 0.0;
                    visavis_session_next_due(pointer(session, pointers, 0), pointer(&mut time, pointers, 1))
                }
                Call::Reset => visavis_session_reset(session),
                Call::WarmUp(one) => {
                    self.blocks += 1;
                    visavis_session_warm_up(session, u32::from(one))
                }
                Call::ThreadIds { capacity, pointers } => {
                    let (mut ids, mut count) = ([0u32; 256], 0usize);
                    let ids = pointer(ids.as_mut_ptr(), pointers, 0);
                    visavis_session_worker_thread_ids(
                        session,
                        ids,
                        usize::from(capacity),
                        pointer(&mut count, pointers, 1),
                    )
                }
                Call::Stats { size, null } => {
                    let mut room = [u64::from_ne_bytes([CANARY; 8]); 128];
                    let size = usize::from(size) % 1024;
                    room.as_mut_ptr().cast::<u32>().write(size as u32);
                    let stats = if null { null_mut() } else { room.as_mut_ptr().cast() };
                    let status = visavis_session_stats(session, stats);
                    intact(&room, size.max(4));
                    status
                }
                Call::Joint { joint, pointers } => {
                    let (mut parent, mut offset) = (0, [0.0f32; 3]);
                    visavis_engine_joint_name(self.engine, joint);
                    let (parent, offset) =
                        (pointer(&mut parent, pointers, 0), pointer(offset.as_mut_ptr(), pointers, 1));
                    visavis_engine_joint(pointer(self.engine, pointers, 2), joint % 64, parent, offset)
                }
                Call::OpenXr(joint, body) => {
                    visavis_engine_openxr_joint(self.engine, u32::from(joint), body);
                    visavis_engine_joint_for_openxr(self.engine, u32::from(joint));
                    assert!(!visavis_engine_name(self.engine).is_null() && visavis_engine_joint_count(null()) == 0);
                    VisavisStatus::Ok
                }
                Call::Memory { from, len, null } => {
                    // A part of a bundle is no bundle.
                    let bytes = small_bundle();
                    let part = &bytes[usize::from(from) % bytes.len()..];
                    let part = &part[..usize::from(len).min(part.len() - 1)];
                    let mut engine = null_mut();
                    let data = if null { std::ptr::null() } else { part.as_ptr() };
                    let status = visavis_engine_from_memory(data, part.len(), &mut engine);
                    assert!(engine.is_null() && status != VisavisStatus::Ok);
                    status
                }
                Call::Path(mut name) => {
                    let mut engine = null_mut();
                    name[0] = b'\x01';
                    name[11] = 0;
                    visavis_engine_from_path(name.as_ptr().cast(), &mut engine)
                }
                Call::Descriptor(offset, length) => {
                    let mut engine = null_mut();
                    visavis_engine_from_fd(-1, offset, length, &mut engine)
                }
                Call::Abi(version) => visavis_check_abi(version),
                Call::Source(id, len, rate, value, [x, y, z], pointers) => {
                    sound.fill(value);
                    let data = pointer(sound.as_mut_ptr(), pointers, 0);
                    let count = if pointers & 3 < 2 { usize::from(len) % sound.len() } else { usize::from(len) << 48 };
                    visavis_session_push_sound(pointer(session, pointers, 1), u32::from(id), data, count, rate, x, y, z)
                }
                Call::GoodSource { id, len, place } => {
                    sound.iter_mut().enumerate().for_each(|(i, s)| *s = 60.0 * (i as f32 * 0.1).sin());
                    let ([x, y, z], count) = (place.map(|v| f32::from(v) / 20.0), usize::from(len) % sound.len());
                    let status =
                        visavis_session_push_sound(session, u32::from(id), sound.as_ptr(), count, 24_000, x, y, z);
                    assert_eq!(status, VisavisStatus::Ok);
                    status
                }
                Call::EndSource(id) => visavis_session_end_sound(session, u32::from(id)),
                Call::Ears(len, rate, values, pointers) => {
                    let (left, right) = sound.split_at_mut(2048);
                    left.fill(values[0]);
                    right.fill(values[1]);
                    let told = pointers & 3 < 2 && pointers >> 2 & 3 < 2;
                    let count = if told { usize::from(len) % left.len() } else { usize::from(len) << 48 };
                    let (left, right) =
                        (pointer(left.as_mut_ptr(), pointers, 0), pointer(right.as_mut_ptr(), pointers, 1));
                    visavis_session_push_ears(pointer(session, pointers, 2), left, right, count, rate)
                }
                Call::GoodEars { len, ahead } => {
                    sound.iter_mut().enumerate().for_each(|(i, s)| *s = 60.0 * (i as f32 * 0.1).sin());
                    let count = usize::from(len) % 2048;
                    let right = sound[usize::from(ahead)..].as_ptr();
                    let status = visavis_session_push_ears(session, sound.as_ptr(), right, count, 24_000);
                    assert_eq!(status, VisavisStatus::Ok);
                    status
                }
                Call::EndEars => visavis_session_end_ears(session),
                Call::Sensitivity(sensitivity) => visavis_session_set_sensitivity(session, sensitivity),
                Call::HeardPlace { pointers } => {
                    let (mut place, mut known) = ([f32::NAN; 4], -1);
                    let to = pointer(place.as_mut_ptr(), pointers, 0);
                    let status = visavis_session_heard_place(
                        pointer(session, pointers, 1),
                        to,
                        pointer(&mut known, pointers, 2),
                    );
                    let told = status == VisavisStatus::Ok;
                    assert!(if told { known == 0 || known == 1 } else { known == -1 }, "{known}");
                    assert!(place[..3].iter().all(|v| v.is_finite() == (known == 1)), "{place:?}");
                    assert!(place[3].is_nan(), "beyond the place");
                    status
                }
            }
        }
    }

    /// Polls into room of exactly the sizes that are told.
    unsafe fn poll(&mut self, now: f64, frame_size: u16, joints: u16, pointers: u8) -> VisavisStatus {
        let session = self.session();
        let right = size_of::<VisavisFrame>();
        let size = if frame_size & 3 == 0 { usize::from(frame_size) >> 2 } else { right };
        let mut frames = vec![u64::from_ne_bytes([CANARY; 8]); (4 * size).div_ceil(8) + 2];
        let capacity = usize::from(joints % 64);
        let canary = VisavisJoint { local: [1e9; 4], position: [1e9; 3], rotation: [1e9; 4] };
        let mut room = vec![canary; capacity + 1];
        let (mut count, mut due) = (u32::MAX, 0.0);
        // SAFETY: as in `make`; the room is as large as is told.
        let status = unsafe {
            visavis_session_next_due(session, &mut due);
            let now = if pointers & 128 == 0 { due } else { now };
            let joints = if capacity == 0 { null_mut() } else { pointer(room.as_mut_ptr(), pointers, 1) };
            let frames = pointer(frames.as_mut_ptr().cast(), pointers, 0);
            visavis_session_poll(session, now, frames, size, joints, capacity, pointer(&mut count, pointers, 2))
        };
        intact(&frames, 4 * size);
        assert!(room[capacity].position == canary.position, "beyond the joints");
        if status == VisavisStatus::Ok && count == 4 {
            self.blocks += 1;
            assert!(room[..capacity.min(40)].iter().all(|j| j.position.iter().chain(&j.local).all(|v| v.is_finite())));
        }
        status
    }
}

/// All bytes after the first `size` are as they were.
fn intact(room: &[u64], size: usize) {
    let bytes = room.iter().flat_map(|word| word.to_ne_bytes());
    assert!(bytes.skip(size).all(|byte| byte == CANARY), "beyond {size} bytes");
}
