//! The clock that blocks are timed with: the system's, or the host's where there is no system.

#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
pub(crate) use std::time::Instant;

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
pub(crate) use host::Instant;

/// WebAssembly without a system: the host is asked.
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
mod host {
    use std::time::Duration;

    #[allow(unsafe_code, reason = "an imported function")]
    #[link(wasm_import_module = "env")]
    unsafe extern "C" {
        /// Milliseconds since an arbitrary moment, as `performance.now()` has them.
        safe fn visavis_now_ms() -> f64;
    }

    /// A moment, in the host's milliseconds.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Instant(f64);

    impl Instant {
        pub(crate) fn now() -> Self {
            Self(visavis_now_ms())
        }

        /// Zero should the host's clock run backwards or give a time that is none.
        pub(crate) fn elapsed(self) -> Duration {
            Duration::try_from_secs_f64((visavis_now_ms() - self.0) / 1000.0).unwrap_or_default()
        }
    }
}
