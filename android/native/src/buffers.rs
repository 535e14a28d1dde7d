//! Direct buffers: memory that Java, or another call, may write to at any moment. So it is never a
//! Rust slice of numbers: it is read and written element by element, each in one relaxed atomic
//! access, which is what the JVM's own accesses are.

use crate::error::{Failure, Outcome};
use jni::Env;
use jni::objects::{JByteBuffer, JObject};
use std::cell::RefCell;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU8, AtomicU32};

/// An element of a buffer as it lies in memory.
pub(crate) trait Element {}

impl Element for AtomicU8 {}
/// The bits of a float.
impl Element for AtomicU32 {}

/// Elements of a direct buffer from `position` on, `count` of them.
///
/// # Safety
/// `buffer`, if not null, is a `java.nio.Buffer` with elements of the size of `T`, in native byte
/// order (Java checks that).
pub(crate) unsafe fn elements<'a, T: Element>(
    env: &Env<'_>,
    buffer: &'a JObject<'_>,
    position: i32,
    count: i32,
) -> Outcome<&'a [T]> {
    if buffer.is_null() {
        return Err(jni::errors::Error::NullPtr("buffer is null").into());
    }
    // SAFETY: only passed to the two functions below, which take any java.nio.Buffer; not an owning
    // reference.
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
    let start = address.cast_const().cast::<T>();
    if !start.is_aligned() {
        return Err(Failure::Argument(format!("the buffer is not aligned to {} bytes", align_of::<T>())));
    }
    // SAFETY: inside the buffer and aligned, any bits are valid, alive as long as the local
    // reference that `buffer` borrows. The slice is of atomics: others may read and write the same
    // memory, as Rust does, by atomic accesses, and as the JVM does, by plain machine accesses to
    // whole elements, which do not tear. Loads are all that is done to a buffer that Java calls
    // read-only, and relaxed loads of this size may be made of memory that cannot be written to.
    Ok(unsafe { std::slice::from_raw_parts(start.add(from), count) })
}

/// A copy of bytes.
pub(crate) fn bytes(of: &[AtomicU8]) -> Vec<u8> {
    of.iter().map(|byte| byte.load(Relaxed)).collect()
}

thread_local! {
    /// Floats on their way from or to Java: as large as the largest part that this thread moved.
    static SCRATCH: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
}

/// Runs `body` on room for `count` floats, which hold anything.
pub(crate) fn with_scratch<T>(count: usize, body: impl FnOnce(&mut [f32]) -> T) -> T {
    SCRATCH.with_borrow_mut(|scratch| {
        scratch.resize(scratch.len().max(count), 0.0);
        body(&mut scratch[..count])
    })
}

/// Runs `body` on a copy of floats.
pub(crate) fn with_floats<T>(of: &[AtomicU32], body: impl FnOnce(&[f32]) -> T) -> T {
    with_scratch(of.len(), |scratch| {
        scratch.iter_mut().zip(of).for_each(|(to, word)| *to = f32::from_bits(word.load(Relaxed)));
        body(scratch)
    })
}

/// Checks a part of an array.
pub(crate) fn part(length: usize, offset: i32, count: i32) -> Outcome<usize> {
    let end = usize::try_from(offset).ok().zip(usize::try_from(count).ok()).map(|(o, c)| o + c);
    if end.is_none_or(|end| end > length) {
        return Err(Failure::Argument(format!("{count} elements from {offset} on, but the array has {length}")));
    }
    Ok(count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use visavis::{Engine, ErrorKind, SessionOptions, SharedSession, Speaker};

    /// What Java may do with one buffer: two threads push from it into one session, and one of them
    /// into both voices, a third changes what is in it, a fourth polls into it. Under the
    /// sanitizers (`tests/sanitize.sh`) as well.
    #[test]
    fn one_buffer_for_all() {
        let bundle = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/goldens/tiny.safetensors");
        let engine = Engine::load(bundle).unwrap();
        let shared = SharedSession::new(engine.session(SessionOptions::default()).unwrap());
        let buffer: Vec<AtomicU32> = (0..4_800).map(|i| AtomicU32::new((i as f32 / 9_600.0).to_bits())).collect();
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    for i in 0..200 {
                        let speaker = [Speaker::Agent, Speaker::User][i % 2];
                        // A frame in the buffer may hold NaN, for a gaze score that is not known.
                        let pushed =
                            with_floats(&buffer[i..i + 480], |sound| shared.voice(speaker).push(sound, 48_000));
                        if let Err(error) = pushed {
                            assert_eq!(error.kind(), ErrorKind::Audio, "{error}");
                        }
                        shared.head().push(visavis::glam::Vec3::Y, i as f64 / 100.0);
                    }
                });
            }
            scope.spawn(|| {
                for number in &buffer[..2_000] {
                    number.store(0.25f32.to_bits(), Relaxed);
                }
            });
            for _ in 0..4 {
                let mut session = shared.lock().unwrap();
                let frames = session.poll(1e6).unwrap().unwrap();
                crate::session::write(frames, |at, value| buffer[at].store(value.to_bits(), Relaxed));
            }
        });
        assert_eq!(shared.lock().unwrap().stats().blocks, 4);
    }
}
