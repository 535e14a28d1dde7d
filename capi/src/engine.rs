//! Engines: loading bundles, and what they hold.

use crate::status::{Failure, Outcome, VisavisStatus, guard};
use crate::structs::{borrow, place, slice};
use std::ffi::{CStr, CString, c_char};
use std::sync::Arc;
use visavis::Engine;
use visavis::openxr::{FB_BODY_JOINTS, OPENXR_JOINTS, openxr_joint};

/// A loaded bundle: immutable, shared by any number of sessions.
pub struct VisavisEngine {
    pub(crate) engine: Arc<Engine>,
    name: CString,
    joints: Vec<CString>,
}

/// A set of OpenXR body joints.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisavisBody {
    /// XR_FB_body_tracking: 70 joints.
    Fb = 0,
    /// XR_META_body_tracking_full_body: the same, and 14 of the legs.
    MetaFullBody = 1,
}

impl VisavisEngine {
    fn new(engine: Arc<Engine>) -> Box<Self> {
        let text = |s: &str| CString::new(s.replace('\0', "?")).unwrap_or_default();
        let (name, joints) = (text(engine.name()), engine.rig().joints.iter().map(|j| text(&j.name)).collect());
        Box::new(Self { engine, name, joints })
    }

    fn joint(&self, joint: u32) -> Outcome<usize> {
        let (joint, count) = (joint as usize, self.joints.len());
        if joint < count { Ok(joint) } else { Err(Failure::argument(format!("joint {joint} of {count}"))) }
    }
}

/// Makes an engine with `load` and hands it out; NULL when that fails.
///
/// # Safety
/// `engine`, if neither null nor misaligned, is a place for a pointer.
unsafe fn hand_out(engine: *mut *mut VisavisEngine, load: impl FnOnce() -> Outcome<Arc<Engine>>) -> VisavisStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { place(engine, "engine") }?.write(std::ptr::null_mut());
        *out = Box::into_raw(VisavisEngine::new(load()?));
        Ok(())
    })
}

/// Loads the bundle at `path` (UTF-8).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_from_path(
    path: *const c_char,
    engine: *mut *mut VisavisEngine,
) -> VisavisStatus {
    let load = || {
        crate::structs::check(path, "path")?;
        // SAFETY: not null; a C string by the ownership chapter.
        let path = unsafe { CStr::from_ptr(path) };
        let path = path.to_str().map_err(|_| Failure::argument("path is not UTF-8"))?;
        Ok(Engine::load(path)?)
    };
    // SAFETY: the header's promise.
    unsafe { hand_out(engine, load) }
}

/// Loads the bundle that lies in an open file, `length` bytes from `offset` on (`length` 0: up to
/// the end), such as an asset stored uncompressed in an APK. The descriptor's read position is not
/// used or moved. Not on Windows.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_from_fd(
    fd: i32,
    offset: u64,
    length: u64,
    engine: *mut *mut VisavisEngine,
) -> VisavisStatus {
    let load = || {
        #[cfg(unix)]
        {
            if fd < 0 {
                return Err(Failure::argument(format!("file descriptor {fd}")));
            }
            // SAFETY: not -1; an open descriptor for the time of this call, by the ownership
            // chapter. A closed one makes the duplication fail.
            let fd = unsafe { std::os::fd::BorrowedFd::borrow_raw(fd) };
            Ok(Engine::from_fd(fd, offset, (length > 0).then_some(length))?)
        }
        #[cfg(not(unix))]
        {
            let _ = (fd, offset, length);
            Err(Failure::argument("file descriptors are not supported on this system: use visavis_engine_from_path"))
        }
    };
    // SAFETY: the header's promise.
    unsafe { hand_out(engine, load) }
}

/// Loads a bundle from `length` bytes of memory, which are not needed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_from_memory(
    bytes: *const u8,
    length: usize,
    engine: *mut *mut VisavisEngine,
) -> VisavisStatus {
    let load = || {
        // SAFETY: the header's promise.
        let bytes = unsafe { slice(bytes, length, "bytes") }?;
        Ok(Engine::from_slice(bytes, "bundle in memory")?)
    };
    // SAFETY: the header's promise.
    unsafe { hand_out(engine, load) }
}

/// Frees an engine; sessions made on it live on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_free(engine: *mut VisavisEngine) {
    guard(|| {
        if !engine.is_null() {
            // SAFETY: made by `hand_out` and not freed before, by the ownership chapter.
            drop(unsafe { Box::from_raw(engine) });
        }
        Ok(())
    });
}

/// Name of the model; NULL for a NULL engine.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_name(engine: *const VisavisEngine) -> *const c_char {
    // SAFETY: the header's promise.
    unsafe { borrow(engine, "engine") }.map_or(std::ptr::null(), |e| e.name.as_ptr())
}

/// Whether the bundle has hearing, so that visavis_session_push_sound is heard: 1 or 0; 0 for a NULL
/// engine. Since interface 1.3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_has_hearing(engine: *const VisavisEngine) -> i32 {
    // SAFETY: the header's promise.
    unsafe { borrow(engine, "engine") }.map_or(0, |e| i32::from(e.engine.has_hearing()))
}

/// Number of joints of a frame; 0 for a NULL engine.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_joint_count(engine: *const VisavisEngine) -> u32 {
    // SAFETY: the header's promise.
    unsafe { borrow(engine, "engine") }.map_or(0, |e| e.joints.len() as u32)
}

/// Name of a joint (VRM humanoid); NULL for a joint that is not there.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_joint_name(engine: *const VisavisEngine, joint: u32) -> *const c_char {
    // SAFETY: the header's promise.
    let name = unsafe { borrow(engine, "engine") }.ok().and_then(|e| e.joints.get(joint as usize));
    name.map_or(std::ptr::null(), |n| n.as_ptr())
}

/// Parent of a joint into `parent` (-1: none), and its rest offset from there into `offset[3]`,
/// metres. Either may be NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_joint(
    engine: *const VisavisEngine,
    joint: u32,
    parent: *mut i32,
    offset: *mut f32,
) -> VisavisStatus {
    guard(|| {
        // SAFETY: the header's promise.
        let engine = unsafe { borrow(engine, "engine") }?;
        let of = &engine.engine.rig().joints[engine.joint(joint)?];
        if !parent.is_null() {
            // SAFETY: the header's promise.
            unsafe { place(parent, "parent") }?.write(of.parent.map_or(-1, |p| p as i32));
        }
        if !offset.is_null() {
            // SAFETY: the header's promise: room for three floats.
            unsafe { place(offset.cast::<[f32; 3]>(), "offset") }?.write(of.offset);
        }
        Ok(())
    })
}

/// Number in OpenXR's `body` (a visavis_body) of the joint that stands for a joint of this engine;
/// -1 if it has none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_openxr_joint(engine: *const VisavisEngine, joint: u32, body: i32) -> i32 {
    // SAFETY: the header's promise.
    let Ok(engine) = (unsafe { borrow(engine, "engine") }) else { return -1 };
    let count = if body == VisavisBody::Fb as i32 { FB_BODY_JOINTS } else { OPENXR_JOINTS.len() };
    let joints = &engine.engine.rig().joints;
    let index = joints.get(joint as usize).and_then(|j| openxr_joint(&j.name)).filter(|&i| i < count);
    index.map_or(-1, |i| i as i32)
}

/// Joint of this engine that OpenXR's body joint `openxr_joint` (below 84) follows: its own, or the
/// nearest one towards the hips; -1 for the root, which is the agent's place on the floor, and for
/// numbers out of range.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_engine_joint_for_openxr(engine: *const VisavisEngine, openxr_joint: u32) -> i32 {
    // SAFETY: the header's promise.
    let Ok(engine) = (unsafe { borrow(engine, "engine") }) else { return -1 };
    let follows = OPENXR_JOINTS.get(openxr_joint as usize).and_then(|j| j.1);
    follows.and_then(|name| engine.engine.rig().index(name)).map_or(-1, |i| i as i32)
}
