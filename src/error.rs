//! The one error type of the public interface.
//!
//! Every [`Error`] says what was being done, to which file or argument, what is wrong and what to
//! do about it. Match on [`Error::kind`]; show the `Display` text to people.

use std::fmt;
use std::path::{Path, PathBuf};

/// What went wrong, for programs to match on.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// A file or folder could not be read or written (missing, permissions, disk full).
    Io,
    /// A bundle is damaged: not safetensors, truncated, bad offsets, NaN or infinite weights.
    BundleCorrupt,
    /// A bundle is sound but of a format version this build does not read.
    BundleVersion,
    /// A bundle's config and tensors disagree: missing tensor, wrong shape or dtype, size out of
    /// range.
    BundleInvalid,
    /// A WAV file, or pushed audio, is not usable (not WAV, cut off, empty, bad rate, non-finite).
    Audio,
    /// A user path CSV is not usable (header, text, NaN, unsorted or duplicate times).
    UserPath,
    /// An argument or option is outside its range, or the combination makes no sense.
    Argument,
    /// `VISAVIS_CPU` asks for a level that this CPU, or this build, does not have.
    CpuLevel,
    /// The call does not fit the session's state (for example polling time that runs backwards).
    State,
}

/// An error: its kind, its subject (a file, if any) and a message that tells what to do.
#[derive(Debug)]
pub struct Error {
    kind: ErrorKind,
    path: Option<PathBuf>,
    message: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

/// Result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// A new error; `message` says what is wrong and what to do.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self { kind, path: None, message: message.into(), source: None }
    }

    /// An I/O error on `path` while doing `what` ("read the bundle").
    pub fn io(what: &str, path: impl AsRef<Path>, source: std::io::Error) -> Self {
        Self {
            kind: ErrorKind::Io,
            path: Some(path.as_ref().to_path_buf()),
            message: format!("cannot {what}: {source}{}", advice(&source)),
            source: Some(Box::new(source)),
        }
    }

    /// The same error naming the file it is about; an inner name is kept.
    #[must_use]
    pub fn with_path(mut self, path: impl AsRef<Path>) -> Self {
        self.path.get_or_insert_with(|| path.as_ref().to_path_buf());
        self
    }

    /// What went wrong, for programs.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The file that the error is about, if it is about one.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }
}

/// What to do where the system's own words do not tell: Windows refuses to open, change or replace
/// files that other programs hold, which other systems do not.
fn advice(source: &std::io::Error) -> &'static str {
    if !cfg!(windows) {
        return "";
    }
    const ACCESS_DENIED: i32 = 5;
    const SHARING_VIOLATION: i32 = 32;
    const LOCK_VIOLATION: i32 = 33;
    const USER_MAPPED_FILE: i32 = 1224;
    match source.raw_os_error() {
        Some(SHARING_VIOLATION | LOCK_VIOLATION) => "; another program has the file open: close it there and try again",
        Some(USER_MAPPED_FILE) => {
            "; a program has the file mapped, as one that is loading a bundle has: close it there, or load with \
             LoadMode::Copy, and try again"
        }
        Some(ACCESS_DENIED) => {
            "; the folder or file is not this user's to write, is read-only, or is in use by another program: close \
             it there or choose another folder"
        }
        _ => "",
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.path {
            Some(path) => write!(f, "{}: {}", path.display(), self.message),
            None => f.write_str(&self.message),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_deref().map(|e| e as _)
    }
}
