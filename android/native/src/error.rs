//! What can go wrong, and the Java exception that it becomes.
//!
//! | error | exception |
//! |---|---|
//! | closed or unknown handle, call that does not fit the state | `IllegalStateException` |
//! | argument out of range, buffer too small or of the wrong kind, audio that is not finite | `IllegalArgumentException` |
//! | null | `NullPointerException` |
//! | file that cannot be read | `java.io.IOException` |
//! | bundle damaged, of another format, inconsistent | `BundleException.Corrupt`, `.Version`, `.Invalid` |
//! | no microphone to be had | `MicrophoneException` |
//! | panic, and anything else | `VisavisException`, with the panic's text |

use jni::Env;
use jni::errors::ErrorPolicy;
use jni::jni_str;
use jni::strings::{JNIStr, JNIString};
use std::any::Any;
use visavis::{Error, ErrorKind};

/// Why a native method failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The runtime refused.
    Visavis(Error),
    /// An argument is of no use.
    Argument(String),
    /// The object was closed, or its state forbids the call.
    State(String),
    /// There is no microphone.
    Microphone(String),
    /// A fault of this library.
    Fault(String),
    /// A JNI call failed; a Java exception may be pending.
    Jni(jni::errors::Error),
}

pub(crate) type Outcome<T = ()> = Result<T, Failure>;

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Self::Visavis(e)
    }
}

impl From<jni::errors::Error> for Failure {
    fn from(e: jni::errors::Error) -> Self {
        Self::Jni(e)
    }
}

impl Failure {
    fn exception(&self) -> &'static JNIStr {
        match self {
            Self::Visavis(e) => match e.kind() {
                ErrorKind::Io => jni_str!("java/io/IOException"),
                ErrorKind::BundleCorrupt => jni_str!("org/visavis/BundleException$Corrupt"),
                ErrorKind::BundleVersion => jni_str!("org/visavis/BundleException$Version"),
                ErrorKind::BundleInvalid => jni_str!("org/visavis/BundleException$Invalid"),
                ErrorKind::Audio | ErrorKind::UserPath | ErrorKind::Argument => {
                    jni_str!("java/lang/IllegalArgumentException")
                }
                ErrorKind::State => jni_str!("java/lang/IllegalStateException"),
                _ => jni_str!("org/visavis/VisavisException"),
            },
            Self::Argument(_) => jni_str!("java/lang/IllegalArgumentException"),
            Self::State(_) => jni_str!("java/lang/IllegalStateException"),
            Self::Microphone(_) => jni_str!("org/visavis/MicrophoneException"),
            Self::Jni(jni::errors::Error::NullPtr(_)) => jni_str!("java/lang/NullPointerException"),
            Self::Fault(_) | Self::Jni(_) => jni_str!("org/visavis/VisavisException"),
        }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Visavis(e) => e.fmt(f),
            Self::Argument(text) | Self::State(text) | Self::Microphone(text) | Self::Fault(text) => f.write_str(text),
            Self::Jni(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for Failure {}

/// The policy of all native methods: throw, and return zero or null.
pub(crate) struct Throw;

impl<T: Default> ErrorPolicy<T, Failure> for Throw {
    type Captures<'local: 'method, 'method> = ();

    fn on_error<'local: 'method, 'method>(env: &mut Env<'local>, _: &mut (), e: Failure) -> jni::errors::Result<T> {
        throw(env, &e);
        Ok(T::default())
    }

    fn on_panic<'local: 'method, 'method>(
        env: &mut Env<'local>,
        _: &mut (),
        payload: Box<dyn Any + Send + 'static>,
    ) -> jni::errors::Result<T> {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no text");
        throw(env, &Failure::Fault(format!("internal fault: {text}")));
        // A payload may panic when dropped; a leak of one is better.
        std::mem::forget(payload);
        Ok(T::default())
    }
}

fn throw(env: &mut Env<'_>, failure: &Failure) {
    // An exception that is pending already says more.
    if env.exception_check() {
        return;
    }
    let text = JNIString::from(failure.to_string());
    // Throwing reports the exception it has thrown as an error. What else may fail here leaves an
    // exception of its own.
    let _ = env.throw_new(failure.exception(), text);
}
