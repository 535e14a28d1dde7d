//! Visavis as a WebAssembly module: a plain C interface of numbers, which `npm/core.js` calls.
//!
//! **Ownership.** Memory that JavaScript fills is taken by [`visavis_alloc`] and given back by
//! [`visavis_free`]. An engine and a session live until they are freed, a session keeps its engine
//! alive. Text (errors, facts, statistics) lies at [`visavis_text`] until the next call.
//!
//! **Results.** A status is 0, or the number of an error's kind, whose text [`visavis_text`] has. A
//! panic leaves its text there too, and traps: nothing of the instance may be called after that.

mod engine;
mod frames;
mod options;
mod session;
mod stats;
mod status;
#[cfg(test)]
mod tests;

pub use engine::*;
pub use frames::{FRAME_NUMBERS, JOINT_NUMBERS};
pub use session::*;
pub use status::{visavis_text, visavis_text_length};

/// Eight bytes, so that whatever JavaScript puts there is aligned.
type Cell = u64;

/// `bytes` bytes of memory, aligned to 8; null for none.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_alloc(bytes: usize) -> *mut u8 {
    if bytes == 0 {
        return std::ptr::null_mut();
    }
    Box::into_raw(vec![0 as Cell; bytes.div_ceil(size_of::<Cell>())].into_boxed_slice()).cast()
}

/// Gives back what [`visavis_alloc`] gave for as many `bytes`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_free(memory: *mut u8, bytes: usize) {
    if !memory.is_null() {
        let cells = std::ptr::slice_from_raw_parts_mut(memory.cast::<Cell>(), bytes.div_ceil(size_of::<Cell>()));
        // SAFETY: the chapter on ownership: made by `visavis_alloc` with this size.
        drop(unsafe { Box::from_raw(cells) });
    }
}

/// `count` values at `from`.
///
/// # Safety
/// The chapter on ownership: they lie in memory of [`visavis_alloc`], which nothing writes to now.
unsafe fn slice<'a, T>(from: *const T, count: usize) -> &'a [T] {
    if count == 0 {
        return &[];
    }
    // SAFETY: the caller's promise.
    unsafe { std::slice::from_raw_parts(from, count) }
}
