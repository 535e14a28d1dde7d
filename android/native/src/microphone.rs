//! The microphone: opened, and emptied into a session's user voice.

use crate::error::{Failure, Outcome, Throw};
use crate::handles::Table;
use crate::native;
use crate::session::around;
use jni::Env;
use jni::objects::{JClass, JLongArray};
use jni::sys::{jboolean, jfloat, jint, jlong};
use std::sync::{Arc, Mutex, PoisonError};
use visavis::Speaker;
use visavis_microphone::{AudioInput, Options, open};

pub(crate) static MICROPHONES: Table<Mutex<Box<dyn AudioInput>>> = Table::new("microphone");

native!("Java_org_visavis_Native_microphoneOpen": microphone_open(rate: jint, seconds: jfloat) -> jlong);
native!("Java_org_visavis_Native_microphoneClose": microphone_close(microphone: jlong) -> jboolean);
native!("Java_org_visavis_Native_microphoneRate": microphone_rate(microphone: jlong) -> jint);
native!("Java_org_visavis_Native_microphoneCounters": microphone_counters(microphone: jlong) -> jlong[]);
native!("Java_org_visavis_Native_microphonePump": microphone_pump(microphone: jlong, session: jlong) -> jint);

fn microphone_open<'l>(_: &mut Env<'l>, _: JClass<'l>, rate: jint, seconds: jfloat) -> Outcome<jlong> {
    let options = Options { rate: u32::try_from(rate).unwrap_or(0), seconds };
    let input = open(options).map_err(|e| Failure::Microphone(e.to_string()))?;
    Ok(MICROPHONES.insert(Arc::new(Mutex::new(input))))
}

fn microphone_close<'l>(_: &mut Env<'l>, _: JClass<'l>, microphone: jlong) -> Outcome<jboolean> {
    Ok(MICROPHONES.remove(microphone))
}

fn of<T>(microphone: jlong, body: impl FnOnce(&mut dyn AudioInput) -> Outcome<T>) -> Outcome<T> {
    let input = MICROPHONES.get(microphone)?;
    let mut input = input.lock().unwrap_or_else(PoisonError::into_inner);
    body(input.as_mut())
}

fn microphone_rate<'l>(_: &mut Env<'l>, _: JClass<'l>, microphone: jlong) -> Outcome<jint> {
    of(microphone, |m| Ok(m.rate() as jint))
}

/// Captured, dropped, and 1 if the stream has ended by itself.
fn microphone_counters<'l>(env: &mut Env<'l>, _: JClass<'l>, microphone: jlong) -> Outcome<JLongArray<'l>> {
    let counters = of(microphone, |m| Ok(m.counters()))?;
    let row = [counters.captured as jlong, counters.dropped as jlong, jlong::from(counters.ended)];
    let array = JLongArray::new(env, row.len())?;
    array.set_region(env, 0, &row)?;
    Ok(array)
}

/// Pushes all that was captured to the session as the user's voice; returns the samples.
fn microphone_pump<'l>(_: &mut Env<'l>, _: JClass<'l>, microphone: jlong, session: jlong) -> Outcome<jint> {
    of(microphone, |m| {
        let (rate, mut samples, mut total) = (m.rate(), [0.0; 1024], 0);
        loop {
            let count = m.read(&mut samples);
            if count == 0 {
                return Ok(total);
            }
            around(session, |shared| Ok(shared.voice(Speaker::User).push(&samples[..count], rate)?))?;
            total += count as jint;
        }
    })
}
