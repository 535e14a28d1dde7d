//! What became of a call, and its text.

use std::cell::RefCell;
use std::sync::Once;
use visavis::{Error, ErrorKind, Result};

thread_local! {
    static TEXT: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Start of the last text: an error, a panic, or what the last call gave. UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_text() -> *const u8 {
    TEXT.with_borrow(|text| text.as_ptr())
}

/// Its length, bytes.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_text_length() -> usize {
    TEXT.with_borrow(String::len)
}

/// Keeps `text` for [`visavis_text`].
pub(crate) fn tell(text: String) {
    TEXT.set(text);
}

/// Number of an error's kind: as in C (`visavis_status`), whose order `npm/errors.js` has.
fn number(kind: ErrorKind) -> i32 {
    match kind {
        ErrorKind::UserPath | ErrorKind::Argument => 1,
        ErrorKind::Io => 2,
        ErrorKind::BundleCorrupt => 3,
        ErrorKind::BundleVersion => 4,
        ErrorKind::BundleInvalid => 5,
        ErrorKind::Audio => 6,
        ErrorKind::State => 7,
        ErrorKind::CpuLevel => 8,
        _ => 12,
    }
}

/// The status of `outcome`, whose error is told.
pub(crate) fn status(outcome: Result<()>) -> i32 {
    match outcome {
        Ok(()) => 0,
        Err(error) => refuse(&error),
    }
}

/// Tells `error`; its status.
pub(crate) fn refuse(error: &Error) -> i32 {
    tell(error.to_string());
    number(error.kind())
}

/// From now on a panic's text is where errors have theirs.
pub(crate) fn tell_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| std::panic::set_hook(Box::new(|panic| tell(format!("internal fault: {panic}")))));
}
