//! Engines.

use crate::slice;
use crate::status::{refuse, tell, tell_panics};
use serde::Serialize;
use std::sync::Arc;
use visavis::{BLOCK_FRAMES, Engine, FPS};

/// What a page wants to know about a bundle.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Facts<'a> {
    version: &'static str,
    kind: &'static str,
    name: &'a str,
    licence: &'a str,
    level: &'static str,
    weight_bytes: usize,
    fps: u32,
    block_frames: usize,
    has_student: bool,
    has_hearing: bool,
    joints: Vec<JointFacts<'a>>,
    eyes: [f32; 3],
    head_back: [f32; 3],
}

#[derive(Serialize)]
struct JointFacts<'a> {
    name: &'a str,
    parent: Option<usize>,
    offset: [f32; 3],
}

/// Loads a bundle that lies in memory, which may be freed afterwards; null is an error, whose
/// status goes to `status`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_new(bundle: *const u8, bytes: usize, status: *mut i32) -> *const Engine {
    tell_panics();
    // SAFETY: the chapter on ownership.
    let loaded = Engine::from_slice(unsafe { slice(bundle, bytes) }, "bundle");
    let (engine, outcome) = match loaded {
        Ok(engine) => (Arc::into_raw(engine), 0),
        Err(error) => (std::ptr::null(), refuse(&error)),
    };
    // SAFETY: room for a number, by the chapter on ownership.
    unsafe { status.write(outcome) };
    engine
}

/// Frees an engine; its sessions go on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_free(engine: *const Engine) {
    // SAFETY: made by `visavis_engine_new`, not freed before.
    drop(unsafe { Arc::from_raw(engine) });
}

/// Tells the engine's facts as JSON.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_facts(engine: *const Engine) {
    // SAFETY: alive, by the chapter on ownership.
    let engine = unsafe { &*engine };
    let rig = engine.rig();
    let joints = rig.joints.iter().map(|j| JointFacts { name: &j.name, parent: j.parent, offset: j.offset }).collect();
    let facts = Facts {
        version: env!("CARGO_PKG_VERSION"),
        kind: engine.kind(),
        name: engine.name(),
        licence: engine.licence(),
        level: engine.cpu_level(),
        weight_bytes: engine.weight_bytes(),
        fps: FPS,
        block_frames: BLOCK_FRAMES,
        has_student: engine.has_student(),
        has_hearing: engine.has_hearing(),
        joints,
        eyes: rig.eyes,
        head_back: rig.head_back,
    };
    tell(serde_json::to_string(&facts).expect("plain data"));
}

/// Another owner of an engine, for a session.
///
/// # Safety
/// It is alive.
pub(crate) unsafe fn shared(engine: *const Engine) -> Arc<Engine> {
    // SAFETY: the caller's promise; the count says that there is one owner more.
    unsafe {
        Arc::increment_strong_count(engine);
        Arc::from_raw(engine)
    }
}
