//! The library itself: version, threads, open objects.

use crate::engine::ENGINES;
use crate::error::{Outcome, Throw};
use crate::microphone::MICROPHONES;
use crate::native;
use crate::session::SESSIONS;
use jni::Env;
use jni::objects::{JClass, JIntArray, JString};
use jni::sys::{jint, jlong};

native!("Java_org_visavis_Native_version": version() -> JString);
native!("Java_org_visavis_Native_currentThreadId": current_thread_id() -> jint);
native!("Java_org_visavis_Native_pinCurrentThread": pin_current_thread(mask: jlong));
native!("Java_org_visavis_Native_openObjects": open_objects() -> jint[]);
native!("Java_org_visavis_Native_panic": panic(text: JString));

fn version<'l>(env: &mut Env<'l>, _: JClass<'l>) -> Outcome<JString<'l>> {
    Ok(JString::from_str(env, env!("CARGO_PKG_VERSION"))?)
}

fn current_thread_id<'l>(_: &mut Env<'l>, _: JClass<'l>) -> Outcome<jint> {
    Ok(visavis::threads::current_thread_id().map_or(0, |id| id as jint))
}

fn pin_current_thread<'l>(_: &mut Env<'l>, _: JClass<'l>, mask: jlong) -> Outcome {
    Ok(visavis::threads::pin_current_thread(mask as u64)?)
}

/// Engines, sessions and microphones that are open.
fn open_objects<'l>(env: &mut Env<'l>, _: JClass<'l>) -> Outcome<JIntArray<'l>> {
    let counts = [ENGINES.len(), SESSIONS.len(), MICROPHONES.len()].map(|n| n as jint);
    let array = JIntArray::new(env, counts.len())?;
    array.set_region(env, 0, &counts)?;
    Ok(array)
}

/// Panics with `text`: the way of a panic to a Java exception, for tests of a build.
fn panic<'l>(env: &mut Env<'l>, _: JClass<'l>, text: JString<'l>) -> Outcome {
    panic!("{}", text.try_to_string(env)?)
}
