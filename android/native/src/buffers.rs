//! Direct buffers, seen as slices for the time of one call.

use crate::error::{Failure, Outcome};
use jni::Env;
use jni::objects::{JByteBuffer, JObject};

/// Elements of a direct buffer from `position` on, `count` of them.
///
/// `buffer` is a `java.nio.Buffer` with elements of the size of `T`, in native byte order (Java checks that).
///
/// # Safety
/// While the slice lives nobody else writes to the buffer: Java holds the session's lock or hands over a buffer of its own.
/// A program that writes to it nevertheless reads changed numbers, which are checked after the copy that follows.
#[expect(clippy::mut_from_ref, reason = "the memory is the Java buffer's, not the reference's")]
pub(crate) unsafe fn elements<'a, T: Copy>(
    env: &Env<'_>,
    buffer: &'a JObject<'_>,
    position: i32,
    count: i32,
) -> Outcome<&'a mut [T]> {
    if buffer.is_null() {
        return Err(jni::errors::Error::NullPtr("buffer is null").into());
    }
    // SAFETY: only passed to the two functions below, which take any java.nio.Buffer; not an owning reference.
    let view = unsafe { JByteBuffer::from_raw(env, buffer.as_raw()) };
    let not_direct = |_| Failure::Argument("the buffer is not direct: use ByteBuffer.allocateDirect".to_owned());
    let address = env.get_direct_buffer_address(&view).map_err(not_direct)?;
    let capacity = env.get_direct_buffer_capacity(&view).map_err(not_direct)?;
    let (from, count) = (usize::try_from(position), usize::try_from(count));
    let (Ok(from), Ok(count)) = (from, count) else {
        return Err(Failure::Argument(format!("position {position}, count {count:?}: not negative")));
    };
    if from.checked_add(count).is_none_or(|end| end > capacity) {
        return Err(Failure::Argument(format!("{count} elements from {from} on, but the buffer holds {capacity}")));
    }
    let start = address.cast::<T>();
    if !start.is_aligned() {
        return Err(Failure::Argument(format!("the buffer is not aligned to {} bytes", align_of::<T>())));
    }
    // SAFETY: inside the buffer, aligned, plain numbers; alive as long as the local reference that `buffer` borrows.
    Ok(unsafe { std::slice::from_raw_parts_mut(start.add(from), count) })
}

/// Checks a part of an array.
pub(crate) fn part(length: usize, offset: i32, count: i32) -> Outcome<usize> {
    let end = usize::try_from(offset).ok().zip(usize::try_from(count).ok()).map(|(o, c)| o + c);
    if end.is_none_or(|end| end > length) {
        return Err(Failure::Argument(format!("{count} elements from {offset} on, but the array has {length}")));
    }
    Ok(count as usize)
}
