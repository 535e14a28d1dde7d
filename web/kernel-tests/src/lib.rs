//! The kernels' tests where there is no test harness. Empty unless it is built with
//! `--features run`, as `web/kernels_check.sh` does.
//!
//! A test is called by its number; what it found, or the message of the panic before the trap, goes
//! to the host's `visavis_report`.
#![cfg(all(target_family = "wasm", feature = "run"))]
#![allow(unsafe_code, reason = "imported and exported functions")]

use std::panic::set_hook;

use visavis::internals::kernels::{agreements, other_tests};

#[link(wasm_import_module = "env")]
unsafe extern "C" {
    /// Takes `len` bytes of UTF-8 at `text`.
    fn visavis_report(text: *const u8, len: usize);
}

fn report(text: &str) {
    // SAFETY: the bytes of `text`, which live through the call.
    unsafe { visavis_report(text.as_ptr(), text.len()) };
}

/// Number of tests.
#[unsafe(no_mangle)]
pub extern "C" fn count() -> usize {
    agreements().len() + other_tests().len()
}

/// Runs test `i`.
#[unsafe(no_mangle)]
pub extern "C" fn run(i: usize) {
    set_hook(Box::new(|panic| report(&panic.to_string())));
    let (agreements, others) = (agreements(), other_tests());
    match agreements.get(i) {
        Some((name, check)) => report(&format!("{name} {}", check())),
        None => {
            let (name, check) = others[i - agreements.len()];
            check();
            report(&format!("{name} - - -"));
        }
    }
}
