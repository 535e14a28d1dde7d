//! Threads and cores.

use crate::status::{VisavisStatus, guard};

/// The kernel's id of the calling thread (gettid), for performance hints; 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_current_thread_id() -> u32 {
    visavis::threads::current_thread_id().unwrap_or(0)
}

/// Lets the calling thread run only on the cores of `mask` (bit i: core i). Linux and Android.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_pin_current_thread(mask: u64) -> VisavisStatus {
    guard(|| Ok(visavis::threads::pin_current_thread(mask)?))
}
