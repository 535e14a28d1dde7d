//! Pointers from C: checked, then turned into references, slices and sized structs.

use crate::status::{Failure, Outcome, VisavisStatus};
use std::mem::{MaybeUninit, size_of};

/// A reference to what `pointer` points to.
///
/// # Safety
/// A pointer that is neither null nor misaligned points to a `T` that outlives `'a`.
pub(crate) unsafe fn borrow<'a, T>(pointer: *const T, name: &str) -> Outcome<&'a T> {
    check(pointer, name)?;
    // SAFETY: checked above as far as it can be; the rest is the caller's promise.
    Ok(unsafe { &*pointer })
}

/// A place to write one `T` to; what is there is not read.
///
/// # Safety
/// As [`borrow`], for writing.
pub(crate) unsafe fn place<'a, T>(pointer: *mut T, name: &str) -> Outcome<&'a mut MaybeUninit<T>> {
    check(pointer, name)?;
    // SAFETY: as above; MaybeUninit makes no claim about what is there.
    Ok(unsafe { &mut *pointer.cast() })
}

/// `count` values; a null pointer will do for none.
///
/// # Safety
/// As [`borrow`], for `count` values.
pub(crate) unsafe fn slice<'a, T>(pointer: *const T, count: usize, name: &str) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, name)?;
    check_count::<T>(count, name)?;
    // SAFETY: as above.
    Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
}

/// Room for `count` values.
///
/// # Safety
/// As [`place`], for `count` values.
pub(crate) unsafe fn room<'a, T>(pointer: *mut T, count: usize, name: &str) -> Outcome<&'a mut [MaybeUninit<T>]> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(pointer, name)?;
    check_count::<T>(count, name)?;
    // SAFETY: as above.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), count) })
}

pub(crate) fn check<T>(pointer: *const T, name: &str) -> Outcome {
    if pointer.is_null() {
        return Err(Failure::argument(format!("{name} is NULL")));
    }
    if !pointer.is_aligned() {
        return Err(Failure::argument(format!("{name} is not aligned to {} bytes", align_of::<T>())));
    }
    Ok(())
}

fn check_count<T>(count: usize, name: &str) -> Outcome {
    if count > isize::MAX as usize / size_of::<T>() {
        return Err(Failure::argument(format!("{name}: {count} elements are more than memory can hold")));
    }
    Ok(())
}

/// A struct of plain numbers, valid with any bits, whose first field says how large the caller
/// believes it to be.
///
/// # Safety
/// `#[repr(C)]`, every bit pattern valid, no padding, `struct_size: u32` first.
pub(crate) unsafe trait Sized32: Copy {
    /// Size of the struct as it was first published: a literal, so that it stays when the struct
    /// grows.
    const FIRST: usize;
    /// Its name in C.
    const NAME: &'static str;

    /// Reads what the caller filled in over `defaults`: an older caller's shorter struct leaves the
    /// rest as it is. A newer caller's longer one is taken if what this library does not know is
    /// zero.
    ///
    /// # Safety
    /// A non-null `pointer` points to as many bytes as its first field says.
    unsafe fn read(pointer: *const Self, defaults: Self) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let size = unsafe { Self::size_at(pointer) }?;
        let mut value = defaults;
        let known = size.min(size_of::<Self>());
        // SAFETY: `known` bytes are inside both structs; any bits are a valid value.
        unsafe { std::ptr::copy_nonoverlapping(pointer.cast::<u8>(), (&raw mut value).cast::<u8>(), known) };
        // SAFETY: bytes from `known` to `size` are the caller's.
        let beyond = unsafe { std::slice::from_raw_parts(pointer.cast::<u8>().add(known), size - known) };
        if beyond.iter().any(|b| *b != 0) {
            let message = format!("{} has fields that this library does not know: update the library", Self::NAME);
            return Err(Failure::new(VisavisStatus::Abi, message));
        }
        Ok(value)
    }

    /// Writes as much of `value` as the caller's struct holds, but for `struct_size`, which stays;
    /// bytes beyond are zeroed.
    ///
    /// # Safety
    /// As [`Sized32::read`], for writing.
    unsafe fn write(pointer: *mut Self, value: &Self) -> Outcome {
        // SAFETY: the caller's promise.
        let size = unsafe { Self::size_at(pointer) }?;
        let known = size.min(size_of::<Self>());
        let first = size_of::<u32>();
        // SAFETY: inside both structs; any bits are a valid value.
        unsafe {
            let (from, to) = ((&raw const *value).cast::<u8>(), pointer.cast::<u8>());
            std::ptr::copy_nonoverlapping(from.add(first), to.add(first), known - first);
            to.add(known).write_bytes(0, size - known);
        }
        Ok(())
    }

    /// The caller's size, checked.
    ///
    /// # Safety
    /// A non-null `pointer` points to at least a `u32`.
    unsafe fn size_at(pointer: *const Self) -> Outcome<usize> {
        check(pointer, Self::NAME)?;
        // SAFETY: not null, aligned, and the first field is a u32.
        let size = unsafe { pointer.cast::<u32>().read() } as usize;
        if (Self::FIRST..=4096).contains(&size) {
            return Ok(size);
        }
        let message = format!("struct_size of {} is {size}: set it to sizeof({})", Self::NAME, Self::NAME);
        Err(Failure::new(VisavisStatus::Abi, message))
    }
}

/// Makes sure that `struct_size` is where [`Sized32`] expects it, and that the struct has only
/// grown since it was `$first` bytes.
macro_rules! sized_struct {
    ($type:ident, $name:literal, $first:literal) => {
        const _: () = assert!(std::mem::offset_of!($type, struct_size) == 0 && size_of::<$type>() >= $first);
        // SAFETY: repr(C), numbers only, padding spelled out (asserted by a test of the layouts).
        unsafe impl crate::structs::Sized32 for $type {
            const FIRST: usize = $first;
            const NAME: &'static str = $name;
        }
    };
}
pub(crate) use sized_struct;

/// What the fields hold that the feature `grown` adds.
#[cfg(feature = "grown")]
pub(crate) const GROWN: u64 = 0x6772_6f77_6e21;
