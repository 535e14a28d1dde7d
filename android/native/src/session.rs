//! Sessions.

use crate::buffers::{elements, part, with_floats, with_scratch};
use crate::engine::ENGINES;
use crate::error::{Failure, Outcome, Throw};
use crate::handles::Table;
use crate::native;
use jni::Env;
use jni::objects::{JClass, JFloatArray, JIntArray, JObject, JString};
use jni::sys::{jboolean, jdouble, jfloat, jint, jlong};
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;
use visavis::glam::Vec3;
use visavis::{BLOCK_FRAMES, Frame, Governor, Root, Session, SessionOptions, SharedSession, Speaker, VoiceInput};

pub(crate) static SESSIONS: Table<SharedSession> = Table::new("session");

/// Floats of a frame before its joints: root x, z, yaw; hips x, y, z; gaze score (NaN: not known);
/// fit error; held; evaluations.
const HEAD: usize = 10;
/// Floats of a joint: local rotation 4, world position 3, world rotation 4.
const JOINT: usize = 11;

native!("Java_org_visavis_Native_sessionNew": session_new(
    engine: jlong, seed: jlong, threads: jint, core_mask: jlong, sampler: JString, gaze: jfloat, guidance: jfloat,
    gaze_guidance: jfloat, temperature: jfloat, x: jdouble, z: jdouble, yaw: jdouble, stance: jboolean, guard: jboolean, budget: jfloat,
    voice_ahead: jdouble, sensitivity: jfloat
) -> jlong);
native!("Java_org_visavis_Native_sessionClose": session_close(session: jlong) -> jboolean);
native!("Java_org_visavis_Native_pushBuffer": push_buffer(session: jlong, voice: jint, buffer: java.nio.FloatBuffer, position: jint, count: jint, rate: jint));
native!("Java_org_visavis_Native_pushArray": push_array(session: jlong, voice: jint, samples: jfloat[], offset: jint, count: jint, rate: jint));
native!("Java_org_visavis_Native_finishVoice": finish_voice(session: jlong, voice: jint));
native!("Java_org_visavis_Native_clearVoice": clear_voice(session: jlong, voice: jint));
native!("Java_org_visavis_Native_setVoicePresent": set_voice_present(session: jlong, voice: jint, present: jboolean));
native!("Java_org_visavis_Native_pushSoundBuffer": push_sound_buffer(
    session: jlong, id: jint, buffer: java.nio.FloatBuffer, position: jint, count: jint, rate: jint, x: jfloat, y: jfloat, z: jfloat
));
native!("Java_org_visavis_Native_pushSoundArray": push_sound_array(
    session: jlong, id: jint, samples: jfloat[], offset: jint, count: jint, rate: jint, x: jfloat, y: jfloat, z: jfloat
));
native!("Java_org_visavis_Native_endSound": end_sound(session: jlong, id: jint));
native!("Java_org_visavis_Native_pushEars": push_ears(session: jlong, left: jfloat[], right: jfloat[], offset: jint, count: jint, rate: jint));
native!("Java_org_visavis_Native_endEars": end_ears(session: jlong));
native!("Java_org_visavis_Native_heardPlace": heard_place(session: jlong, out: jfloat[], offset: jint) -> jboolean);
native!("Java_org_visavis_Native_setSensitivity": set_sensitivity(session: jlong, sensitivity: jfloat));
native!("Java_org_visavis_Native_pushHead": push_head(session: jlong, x: jfloat, y: jfloat, z: jfloat, time: jdouble));
native!("Java_org_visavis_Native_pushPose": push_pose(
    session: jlong, x: jfloat, y: jfloat, z: jfloat, qx: jfloat, qy: jfloat, qz: jfloat, qw: jfloat, time: jdouble
));
native!("Java_org_visavis_Native_dyadic": dyadic(session: jlong, out: jfloat[], offset: jint) -> jint);
native!("Java_org_visavis_Native_setGaze": set_gaze(session: jlong, target: jfloat));
native!("Java_org_visavis_Native_setNaturalGaze": set_natural_gaze(session: jlong));
native!("Java_org_visavis_Native_setGuidance": set_guidance(session: jlong, weight: jfloat, gaze: jfloat));
native!("Java_org_visavis_Native_setSampler": set_sampler(session: jlong, sampler: JString));
native!("Java_org_visavis_Native_setBudget": set_budget(session: jlong, milliseconds: jfloat));
native!("Java_org_visavis_Native_setFallback": set_fallback(session: jlong, engine: jlong));
native!("Java_org_visavis_Native_reportBlockTime": report_block_time(session: jlong, milliseconds: jdouble));
native!("Java_org_visavis_Native_sampler": sampler(session: jlong) -> JString);
native!("Java_org_visavis_Native_pollBuffer": poll_buffer(session: jlong, now: jdouble, out: java.nio.FloatBuffer, position: jint, count: jint) -> jint);
native!("Java_org_visavis_Native_pollArray": poll_array(session: jlong, now: jdouble, out: jfloat[], offset: jint) -> jint);
native!("Java_org_visavis_Native_nextDue": next_due(session: jlong) -> jdouble);
native!("Java_org_visavis_Native_reset": reset(session: jlong));
native!("Java_org_visavis_Native_warmUp": warm_up(session: jlong, blocks: jint));
native!("Java_org_visavis_Native_workerThreadIds": worker_thread_ids(session: jlong) -> jint[]);

/// Runs `body` on what goes around a session: inputs and controls, whoever is inside it. Waits for
/// nobody.
pub(crate) fn around<T>(session: jlong, body: impl FnOnce(&SharedSession) -> Outcome<T>) -> Outcome<T> {
    let shared = SESSIONS.get(session)?;
    if shared.is_poisoned() {
        return Err(poisoned());
    }
    body(&shared)
}

/// Runs `body` on a session; calls from several threads take turns.
pub(crate) fn with<T>(session: jlong, body: impl FnOnce(&mut Session) -> Outcome<T>) -> Outcome<T> {
    around(session, |shared| body(&mut *shared.lock().map_err(|_| poisoned())?))
}

fn poisoned() -> Failure {
    Failure::Fault("this session met an internal fault before: close it and make another".to_owned())
}

fn of(session: jlong, voice: jint, body: impl FnOnce(&VoiceInput)) -> Outcome {
    around(session, |shared| {
        body(shared.voice(Speaker::try_from(voice)?));
        Ok(())
    })
}

fn rate(rate: jint) -> Outcome<u32> {
    u32::try_from(rate).map_err(|_| Failure::Argument(format!("a sample rate of {rate} Hz is negative")))
}

#[expect(clippy::too_many_arguments, reason = "one for each option")]
fn session_new<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    engine: jlong,
    seed: jlong,
    threads: jint,
    core_mask: jlong,
    sampler: JString<'l>,
    gaze: jfloat,
    guidance: jfloat,
    gaze_guidance: jfloat,
    temperature: jfloat,
    x: jdouble,
    z: jdouble,
    yaw: jdouble,
    stance: jboolean,
    guard: jboolean,
    budget: jfloat,
    voice_ahead: jdouble,
    sensitivity: jfloat,
) -> Outcome<jlong> {
    let engine = ENGINES.get(engine)?;
    // NaN is what Java's options hold for "the bundle's".
    let given = |v: f32| (!v.is_nan()).then_some(v);
    let options = SessionOptions {
        seed: seed as u64,
        threads: usize::try_from(threads).unwrap_or(0),
        core_mask: (core_mask != 0).then_some(core_mask as u64),
        sampler: sampler.try_to_string(env)?.parse()?,
        gaze: given(gaze),
        guidance: given(guidance),
        gaze_guidance: given(gaze_guidance),
        temperature: given(temperature),
        start: Root { x, z, yaw },
        stance,
        guard,
        governor: Governor::within(budget),
        voice_ahead,
        sensitivity,
        ..Default::default()
    };
    Ok(SESSIONS.insert(Arc::new(SharedSession::new(engine.session(options)?))))
}

fn session_close<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome<jboolean> {
    Ok(SESSIONS.remove(session))
}

#[expect(clippy::too_many_arguments, reason = "a buffer is three of them")]
fn push_buffer<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    voice: jint,
    buffer: JObject<'l>,
    position: jint,
    count: jint,
    rate_: jint,
) -> Outcome {
    around(session, |shared| {
        // SAFETY: a FloatBuffer; Java has checked the order of its bytes.
        let samples = unsafe { elements(env, &buffer, position, count) }?;
        let (voice, rate) = (shared.voice(Speaker::try_from(voice)?), rate(rate_)?);
        Ok(with_floats(samples, |samples| voice.push(samples, rate))?)
    })
}

#[expect(clippy::too_many_arguments, reason = "a part of an array is three of them")]
fn push_array<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    voice: jint,
    samples: JFloatArray<'l>,
    offset: jint,
    count: jint,
    rate_: jint,
) -> Outcome {
    with_part(env, &samples, offset, count, |samples| {
        around(session, |shared| Ok(shared.voice(Speaker::try_from(voice)?).push(samples, rate(rate_)?)?))
    })
}

/// Runs `body` on a copy of a part of an array.
fn with_part<'l>(
    env: &mut Env<'l>,
    samples: &JFloatArray<'l>,
    offset: jint,
    count: jint,
    body: impl FnOnce(&[f32]) -> Outcome,
) -> Outcome {
    if samples.is_null() {
        return Err(jni::errors::Error::NullPtr("samples are null").into());
    }
    let count = part(samples.len(env)?, offset, count)?;
    with_scratch(count, |scratch| {
        samples.get_region(env, offset, scratch)?;
        body(scratch)
    })
}

#[expect(clippy::too_many_arguments, reason = "a buffer and a place are three each")]
fn push_sound_buffer<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    id: jint,
    buffer: JObject<'l>,
    position: jint,
    count: jint,
    rate_: jint,
    x: jfloat,
    y: jfloat,
    z: jfloat,
) -> Outcome {
    around(session, |shared| {
        // SAFETY: a FloatBuffer; Java has checked the order of its bytes.
        let samples = unsafe { elements(env, &buffer, position, count) }?;
        let rate = rate(rate_)?;
        Ok(with_floats(samples, |samples| shared.sounds().push(id as u32, samples, rate, Vec3::new(x, y, z)))?)
    })
}

#[expect(clippy::too_many_arguments, reason = "a part of an array and a place are three each")]
fn push_sound_array<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    id: jint,
    samples: JFloatArray<'l>,
    offset: jint,
    count: jint,
    rate_: jint,
    x: jfloat,
    y: jfloat,
    z: jfloat,
) -> Outcome {
    with_part(env, &samples, offset, count, |samples| {
        around(session, |shared| Ok(shared.sounds().push(id as u32, samples, rate(rate_)?, Vec3::new(x, y, z))?))
    })
}

fn end_sound<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, id: jint) -> Outcome {
    around(session, |shared| Ok(shared.sounds().end(id as u32)?))
}

#[expect(clippy::too_many_arguments, reason = "a part of two arrays is four")]
fn push_ears<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    left: JFloatArray<'l>,
    right: JFloatArray<'l>,
    offset: jint,
    count: jint,
    rate_: jint,
) -> Outcome {
    if left.is_null() || right.is_null() {
        return Err(jni::errors::Error::NullPtr("samples are null").into());
    }
    let count = part(left.len(env)?, offset, count)?.min(part(right.len(env)?, offset, count)?);
    with_scratch(2 * count, |scratch| {
        let (first, second) = scratch.split_at_mut(count);
        left.get_region(env, offset, first)?;
        right.get_region(env, offset, second)?;
        around(session, |shared| Ok(shared.sounds().push_ears(first, second, rate(rate_)?)?))
    })
}

fn end_ears<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome {
    around(session, |shared| Ok(shared.sounds().end_ears()?))
}

/// Writes where the last block took what stands out to be; returns whether that is known, and leaves
/// `out` as it was where it is not.
fn heard_place<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    out: JFloatArray<'l>,
    offset: jint,
) -> Outcome<jboolean> {
    if out.is_null() {
        return Err(jni::errors::Error::NullPtr("out is null").into());
    }
    part(out.len(env)?, offset, 3)?;
    let Some(place) = with(session, |s| Ok(s.heard_place()))? else { return Ok(false) };
    out.set_region(env, offset, &place.to_array())?;
    Ok(true)
}

fn finish_voice<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, voice: jint) -> Outcome {
    of(session, voice, VoiceInput::finish)
}

fn clear_voice<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, voice: jint) -> Outcome {
    of(session, voice, VoiceInput::clear)
}

fn set_voice_present<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, voice: jint, present: jboolean) -> Outcome {
    of(session, voice, |voice| voice.set_present(present))
}

fn push_head<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, x: f32, y: f32, z: f32, time: f64) -> Outcome {
    around(session, |shared| {
        shared.head().push(Vec3::new(x, y, z), time);
        Ok(())
    })
}

#[allow(clippy::too_many_arguments, reason = "numbers of a pose, one by one as Java has them")]
fn push_pose<'l>(
    _: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    x: f32,
    y: f32,
    z: f32,
    qx: f32,
    qy: f32,
    qz: f32,
    qw: f32,
    time: f64,
) -> Outcome {
    around(session, |shared| {
        shared.head().push_numbers([x, y, z, qx, qy, qz, qw], time);
        Ok(())
    })
}

/// Writes how much each joint follows the user in the last block's frames; returns how many numbers
/// those are, 0 where the bundle has no such read-out.
fn dyadic<'l>(env: &mut Env<'l>, _: JClass<'l>, session: jlong, out: JFloatArray<'l>, offset: jint) -> Outcome<jint> {
    if out.is_null() {
        return Err(jni::errors::Error::NullPtr("out is null").into());
    }
    let there = out.len(env)?;
    with(session, |s| {
        let shares = || s.frames().into_iter().flatten().flat_map(|frame| &frame.dyadic);
        let (needed, room) = (shares().count(), there.saturating_sub(usize::try_from(offset).unwrap_or(there)));
        if room < needed {
            return Err(Failure::Argument(format!("room for {room} floats, but a block has {needed} shares")));
        }
        with_scratch(needed, |scratch| {
            scratch.iter_mut().zip(shares()).for_each(|(to, share)| *to = *share);
            out.set_region(env, offset, scratch)?;
            Ok(needed as jint)
        })
    })
}

fn set_gaze<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, target: jfloat) -> Outcome {
    around(session, |s| Ok(s.controls().set_gaze(Some(target))?))
}

fn set_natural_gaze<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome {
    around(session, |s| Ok(s.controls().set_gaze(None)?))
}

fn set_guidance<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, weight: jfloat, gaze: jfloat) -> Outcome {
    around(session, |s| Ok(s.controls().set_guidance(weight, gaze)?))
}

fn set_sampler<'l>(env: &mut Env<'l>, _: JClass<'l>, session: jlong, sampler: JString<'l>) -> Outcome {
    let sampler = sampler.try_to_string(env)?.parse()?;
    around(session, |s| Ok(s.controls().set_sampler(sampler)?))
}

fn set_sensitivity<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, sensitivity: jfloat) -> Outcome {
    around(session, |s| Ok(s.controls().set_sensitivity(sensitivity)?))
}

fn set_budget<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, milliseconds: jfloat) -> Outcome {
    around(session, |s| Ok(s.controls().set_budget(milliseconds)?))
}

fn set_fallback<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, engine: jlong) -> Outcome {
    let engine = ENGINES.get(engine)?;
    with(session, |s| Ok(s.set_fallback(&engine)?))
}

fn report_block_time<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, milliseconds: jdouble) -> Outcome {
    around(session, |s| Ok(s.controls().report_block_time(milliseconds)?))
}

fn sampler<'l>(env: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome<JString<'l>> {
    let name = with(session, |s| Ok(s.sampler().to_string()))?;
    Ok(JString::from_str(env, name)?)
}

/// Hands the frames of a block to `put`, `HEAD + JOINT * joints` floats each, with their places.
pub(crate) fn write(frames: &[Frame], mut put: impl FnMut(usize, f32)) {
    let mut at = 0;
    let mut put_all = |values: &[f32]| {
        for value in values {
            put(at, *value);
            at += 1;
        }
    };
    for f in frames {
        put_all(&[f.root.x as f32, f.root.z as f32, f.root.yaw as f32]);
        put_all(&f.hips.to_array());
        put_all(&[f.gaze.unwrap_or(f32::NAN), f.fit_error, f.held, f.sampler.evaluations() as f32]);
        for (global, local) in f.global.iter().zip(&f.local) {
            put_all(&local.to_array());
            put_all(&global.position.to_array());
            put_all(&global.rotation.to_array());
        }
    }
}

/// Floats of a block of this session.
fn block_floats(session: &Session) -> usize {
    BLOCK_FRAMES * (HEAD + JOINT * session.engine().rig().joints.len())
}

fn room(session: &Session, there: usize) -> Outcome<usize> {
    let needed = block_floats(session);
    if there < needed {
        return Err(Failure::Argument(format!(
            "room for {there} floats, but a block has {needed}: FrameLayout.blockFloats()"
        )));
    }
    Ok(needed)
}

fn poll_buffer<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    now: jdouble,
    out: JObject<'l>,
    position: jint,
    count: jint,
) -> Outcome<jint> {
    with(session, |s| {
        let needed = room(s, usize::try_from(count).unwrap_or(0))?;
        // SAFETY: a FloatBuffer that is not read-only; Java has checked that, and the order of its
        // bytes.
        let out: &[AtomicU32] = unsafe { elements(env, &out, position, needed as jint) }?;
        let Some(frames) = s.poll(now)? else { return Ok(0) };
        write(frames, |at, value| out[at].store(value.to_bits(), Relaxed));
        Ok(frames.len() as jint)
    })
}

fn poll_array<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    session: jlong,
    now: jdouble,
    out: JFloatArray<'l>,
    offset: jint,
) -> Outcome<jint> {
    if out.is_null() {
        return Err(jni::errors::Error::NullPtr("out is null").into());
    }
    let there = out.len(env)?;
    with(session, |s| {
        let needed = room(s, there.saturating_sub(usize::try_from(offset).unwrap_or(there)))?;
        let Some(frames) = s.poll(now)? else { return Ok(0) };
        with_scratch(needed, |scratch| {
            write(frames, |at, value| scratch[at] = value);
            out.set_region(env, offset, scratch)?;
            Ok(frames.len() as jint)
        })
    })
}

fn next_due<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome<jdouble> {
    with(session, |s| Ok(s.next_due()))
}

fn reset<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome {
    with(session, |s| Ok(s.reset()?))
}

fn warm_up<'l>(_: &mut Env<'l>, _: JClass<'l>, session: jlong, blocks: jint) -> Outcome {
    let blocks = u32::try_from(blocks).map_err(|_| Failure::Argument(format!("{blocks} blocks: not negative")))?;
    with(session, |s| Ok(s.warm_up(blocks)?))
}

fn worker_thread_ids<'l>(env: &mut Env<'l>, _: JClass<'l>, session: jlong) -> Outcome<JIntArray<'l>> {
    let ids: Vec<jint> = with(session, |s| Ok(s.worker_thread_ids().map(|id| id as jint).collect()))?;
    let array = JIntArray::new(env, ids.len())?;
    array.set_region(env, 0, &ids)?;
    Ok(array)
}
