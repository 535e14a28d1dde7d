//! Engines.

use crate::buffers::{bytes, elements};
use crate::error::{Failure, Outcome, Throw};
use crate::handles::Table;
use crate::native;
use jni::Env;
use jni::objects::{JByteArray, JByteBuffer, JClass, JFloatArray, JIntArray, JObjectArray, JString};
use jni::sys::{jboolean, jint, jlong};
use std::sync::Arc;
use visavis::Engine;
use visavis::openxr::{OPENXR_JOINTS, openxr_joint};

pub(crate) static ENGINES: Table<Engine> = Table::new("engine");

native!("Java_org_visavis_Native_engineFromPath": engine_from_path(path: JString) -> jlong);
native!("Java_org_visavis_Native_engineFromFd": engine_from_fd(fd: jint, offset: jlong, length: jlong) -> jlong);
native!("Java_org_visavis_Native_engineFromBuffer": engine_from_buffer(buffer: java.nio.ByteBuffer, position: jint, length: jint) -> jlong);
native!("Java_org_visavis_Native_engineFromBytes": engine_from_bytes(bytes: jbyte[]) -> jlong);
native!("Java_org_visavis_Native_engineClose": engine_close(engine: jlong) -> jboolean);
native!("Java_org_visavis_Native_engineName": engine_name(engine: jlong) -> JString);
native!("Java_org_visavis_Native_engineHasStudent": engine_has_student(engine: jlong) -> jboolean);
native!("Java_org_visavis_Native_engineHasHearing": engine_has_hearing(engine: jlong) -> jboolean);
native!("Java_org_visavis_Native_engineJointNames": engine_joint_names(engine: jlong) -> JString[]);
native!("Java_org_visavis_Native_engineJointParents": engine_joint_parents(engine: jlong) -> jint[]);
native!("Java_org_visavis_Native_engineRestOffsets": engine_rest_offsets(engine: jlong) -> jfloat[]);
native!("Java_org_visavis_Native_openXrNames": open_xr_names() -> JString[]);
native!("Java_org_visavis_Native_openXrFollows": open_xr_follows() -> JString[]);
native!("Java_org_visavis_Native_openXrJoint": open_xr_joint(name: JString) -> jint);

fn engine_from_path<'l>(env: &mut Env<'l>, _: JClass<'l>, path: JString<'l>) -> Outcome<jlong> {
    Ok(ENGINES.insert(Engine::load(path.try_to_string(env)?)?))
}

/// The descriptor stays Java's: what is mapped is a duplicate.
fn engine_from_fd<'l>(_: &mut Env<'l>, _: JClass<'l>, fd: jint, offset: jlong, length: jlong) -> Outcome<jlong> {
    let argument = |what: &str| Failure::Argument(format!("{what} is negative"));
    let offset = u64::try_from(offset).map_err(|_| argument("offset"))?;
    // AssetFileDescriptor.UNKNOWN_LENGTH is -1.
    let length = u64::try_from(length).ok();
    if fd < 0 {
        return Err(argument("the file descriptor"));
    }
    // SAFETY: not -1, and open for the time of this call: Java holds the ParcelFileDescriptor.
    // Duplicating a closed one fails.
    let fd = unsafe { std::os::fd::BorrowedFd::borrow_raw(fd) };
    Ok(ENGINES.insert(Engine::from_fd(fd, offset, length)?))
}

fn engine_from_buffer<'l>(
    env: &mut Env<'l>,
    _: JClass<'l>,
    buffer: JByteBuffer<'l>,
    position: jint,
    length: jint,
) -> Outcome<jlong> {
    // SAFETY: a ByteBuffer.
    let there = unsafe { elements(env, buffer.as_ref(), position, length) }?;
    Ok(ENGINES.insert(Engine::from_bytes(bytes(there), "bundle in memory")?))
}

fn engine_from_bytes<'l>(env: &mut Env<'l>, _: JClass<'l>, bytes: JByteArray<'l>) -> Outcome<jlong> {
    if bytes.is_null() {
        return Err(jni::errors::Error::NullPtr("bytes are null").into());
    }
    let bytes = env.convert_byte_array(&bytes)?;
    Ok(ENGINES.insert(Engine::from_bytes(bytes, "bundle in memory")?))
}

fn engine_close<'l>(_: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<jboolean> {
    Ok(ENGINES.remove(engine))
}

fn engine_name<'l>(env: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<JString<'l>> {
    Ok(JString::from_str(env, ENGINES.get(engine)?.name())?)
}

fn engine_has_student<'l>(_: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<jboolean> {
    Ok(ENGINES.get(engine)?.has_student())
}

fn engine_has_hearing<'l>(_: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<jboolean> {
    Ok(ENGINES.get(engine)?.has_hearing())
}

fn engine_joint_names<'l>(env: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<JObjectArray<'l, JString<'l>>> {
    let engine = ENGINES.get(engine)?;
    strings(env, engine.rig().joints.iter().map(|j| Some(j.name.as_str())).collect())
}

fn engine_joint_parents<'l>(env: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<JIntArray<'l>> {
    let engine = ENGINES.get(engine)?;
    let parents: Vec<jint> = engine.rig().joints.iter().map(|j| j.parent.map_or(-1, |p| p as jint)).collect();
    let array = JIntArray::new(env, parents.len())?;
    array.set_region(env, 0, &parents)?;
    Ok(array)
}

fn engine_rest_offsets<'l>(env: &mut Env<'l>, _: JClass<'l>, engine: jlong) -> Outcome<JFloatArray<'l>> {
    let engine: Arc<Engine> = ENGINES.get(engine)?;
    let offsets: Vec<f32> = engine.rig().joints.iter().flat_map(|j| j.offset).collect();
    let array = JFloatArray::new(env, offsets.len())?;
    array.set_region(env, 0, &offsets)?;
    Ok(array)
}

fn open_xr_names<'l>(env: &mut Env<'l>, _: JClass<'l>) -> Outcome<JObjectArray<'l, JString<'l>>> {
    strings(env, OPENXR_JOINTS.iter().map(|j| Some(j.0)).collect())
}

fn open_xr_follows<'l>(env: &mut Env<'l>, _: JClass<'l>) -> Outcome<JObjectArray<'l, JString<'l>>> {
    strings(env, OPENXR_JOINTS.iter().map(|j| j.1).collect())
}

fn open_xr_joint<'l>(env: &mut Env<'l>, _: JClass<'l>, name: JString<'l>) -> Outcome<jint> {
    Ok(openxr_joint(&name.try_to_string(env)?).map_or(-1, |i| i as jint))
}

/// A Java array of strings; `None` becomes null.
fn strings<'l>(env: &mut Env<'l>, texts: Vec<Option<&str>>) -> Outcome<JObjectArray<'l, JString<'l>>> {
    let array = JObjectArray::<JString>::new(env, texts.len(), JString::null())?;
    for (i, text) in texts.iter().enumerate() {
        if let Some(text) = text {
            let text = JString::from_str(env, text)?;
            array.set_element(env, i, &text)?;
            env.delete_local_ref(text);
        }
    }
    Ok(array)
}
