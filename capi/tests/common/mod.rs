//! What the tests of several threads and of allocations begin with.

use std::ptr::{null, null_mut};
use visavis_c::*;

/// An engine of the tiny bundle with hearing and a session with default options, for the test to
/// free.
pub fn tiny() -> (*mut VisavisEngine, *mut VisavisSession) {
    let bundle =
        std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/goldens/hearing.safetensors")).expect("a bundle");
    let (mut engine, mut session) = (null_mut(), null_mut());
    // SAFETY: a slice, places for pointers, an engine that lives on.
    unsafe {
        assert_eq!(visavis_engine_from_memory(bundle.as_ptr(), bundle.len(), &mut engine), VisavisStatus::Ok);
        assert_eq!(visavis_session_new(engine, null(), &mut session), VisavisStatus::Ok);
    }
    (engine, session)
}
