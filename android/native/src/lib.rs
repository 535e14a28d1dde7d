//! The native half of `org.visavis`: one function for each native method of `org.visavis.Native`.
//!
//! Java objects hold numbers, never pointers: entries of the tables in [`handles`]. Errors and
//! panics become exceptions ([`error`]). Nothing calls back into Java. Audio goes in and frames
//! come out through direct buffers or arrays ([`buffers`]).

mod buffers;
mod engine;
mod error;
mod handles;
mod microphone;
mod session;
mod stats;
mod system;

/// Exports a function as the static native method of `org.visavis.Native` with its name in camel
/// case; the export is spelled out, since the short name is what both Java and the check of the AAR
/// look for.
macro_rules! native {
    ($export:tt: $($signature:tt)*) => {
        const _: jni::NativeMethod = jni::native_method! {
            java_type = "org.visavis.Native",
            export = $export,
            error_policy = Throw,
            static fn $($signature)*,
        };
    };
}
pub(crate) use native;
