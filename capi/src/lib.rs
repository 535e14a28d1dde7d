//! The C interface of Visavis. What a C programmer reads is `include/visavis.h`, generated from
//! this crate; the ownership chapter at its head (`header.txt`) holds for every function here.
//!
//! Each function runs inside [`status::guard`]: null and misaligned pointers, bad values and panics
//! become a status, and the text of [`visavis_last_error`].

mod engine;
mod frames;
mod options;
mod session;
mod stats;
mod status;
mod structs;
mod threads;

pub use engine::*;
pub use frames::{VisavisFrame, VisavisJoint};
pub use options::*;
pub use session::*;
pub use stats::*;
pub use status::{VisavisStatus, visavis_last_error};
pub use threads::*;

use std::ffi::c_char;

/// Version of this interface, 1.3: major number in the upper 16 bits, minor in the lower.
pub const VISAVIS_ABI_VERSION: u32 = (1 << 16) | 3;

/// Frames that a poll gives when a block is due.
pub const VISAVIS_BLOCK_FRAMES: usize = 4;
const _: () = assert!(VISAVIS_BLOCK_FRAMES == visavis::BLOCK_FRAMES);

/// Version of the interface that the library has.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_abi_version() -> u32 {
    VISAVIS_ABI_VERSION
}

/// Whether a program compiled for `abi_version` (pass VISAVIS_ABI_VERSION) can use this library.
#[unsafe(no_mangle)]
pub extern "C" fn visavis_check_abi(abi_version: u32) -> VisavisStatus {
    status::guard(|| {
        let (wanted, have) =
            ((abi_version >> 16, abi_version & 0xffff), (VISAVIS_ABI_VERSION >> 16, VISAVIS_ABI_VERSION & 0xffff));
        if wanted.0 == have.0 && wanted.1 <= have.1 {
            return Ok(());
        }
        let message = format!(
            "compiled for interface {}.{}, but this library has {}.{}: use the visavis.h that came with it",
            wanted.0, wanted.1, have.0, have.1
        );
        Err(status::Failure::new(VisavisStatus::Abi, message))
    })
}

/// Version of the library, such as "0.1.0".
#[unsafe(no_mangle)]
pub extern "C" fn visavis_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}
