//! Status codes, the last error of a thread, and the edge that no panic crosses.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use visavis::{Error, ErrorKind};

/// What became of a call.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisavisStatus {
    /// Done.
    Ok = 0,
    /// A null or misaligned pointer, a value out of range, an array too small.
    Argument = 1,
    /// A file could not be read.
    Io = 2,
    /// The bundle is damaged: truncated, not safetensors, weights that are not finite.
    BundleCorrupt = 3,
    /// The bundle is of a format that this library does not read.
    BundleVersion = 4,
    /// The bundle's config and tensors disagree.
    BundleInvalid = 5,
    /// Audio of a bad rate, of which nothing was taken, or samples that are not finite, in whose
    /// place there is silence.
    Audio = 6,
    /// The call does not fit the session's state, for example time that runs backwards.
    State = 7,
    /// VISAVIS_CPU asks for a level that this CPU does not have.
    CpuLevel = 8,
    /// Another thread is inside this session. Pushes and settings never meet this.
    Busy = 9,
    /// Program and library do not fit together.
    Abi = 10,
    /// A fault of the library; please report the text.
    Panic = 11,
    /// Any other error.
    Other = 12,
}

/// A status that is not `Ok`, and the text that goes with it.
pub(crate) struct Failure {
    status: VisavisStatus,
    message: String,
}

pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl Failure {
    pub(crate) fn new(status: VisavisStatus, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self::new(VisavisStatus::Argument, message)
    }
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        let status = match e.kind() {
            ErrorKind::Io => VisavisStatus::Io,
            ErrorKind::BundleCorrupt => VisavisStatus::BundleCorrupt,
            ErrorKind::BundleVersion => VisavisStatus::BundleVersion,
            ErrorKind::BundleInvalid => VisavisStatus::BundleInvalid,
            ErrorKind::Audio => VisavisStatus::Audio,
            ErrorKind::UserPath | ErrorKind::Argument => VisavisStatus::Argument,
            ErrorKind::CpuLevel => VisavisStatus::CpuLevel,
            ErrorKind::State => VisavisStatus::State,
            _ => VisavisStatus::Other,
        };
        Self::new(status, e.to_string())
    }
}

thread_local! {
    /// `None` after a call that succeeded: such calls do not allocate.
    static LAST: RefCell<Option<CString>> = const { RefCell::new(None) };
}

/// Text of the last error of the calling thread; empty after a call that succeeded. UTF-8, never
/// NULL.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_last_error() -> *const c_char {
    // A thread that is ending has no text any more.
    LAST.try_with(|last| last.borrow().as_ref().map(|text| text.as_ptr())).ok().flatten().unwrap_or(c"".as_ptr())
}

/// Runs the body of an exported function and makes a status of what comes out.
pub(crate) fn guard(body: impl FnOnce() -> Outcome) -> VisavisStatus {
    let outcome = catch_unwind(AssertUnwindSafe(body))
        .unwrap_or_else(|payload| Err(Failure::new(VisavisStatus::Panic, panic_text(payload.as_ref()))));
    let (status, text) = match outcome {
        Ok(()) => (VisavisStatus::Ok, None),
        Err(failure) => (failure.status, CString::new(failure.message.replace('\0', "?")).ok()),
    };
    let _ = LAST.try_with(|last| last.replace(text));
    status
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no text");
    format!("internal fault: {text}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    #[test]
    fn panics_become_a_status_with_their_text() {
        let number = 7;
        assert_eq!(guard(|| panic!("number {number}")), VisavisStatus::Panic);
        // SAFETY: the text lives until the next call.
        let text = unsafe { CStr::from_ptr(visavis_last_error()) };
        assert_eq!(text.to_str().unwrap(), "internal fault: number 7");
        assert_eq!(guard(|| Ok(())), VisavisStatus::Ok);
        // SAFETY: as above.
        assert!(unsafe { CStr::from_ptr(visavis_last_error()) }.is_empty());
    }
}
