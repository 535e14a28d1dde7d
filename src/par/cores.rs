//! Which cores a thread may run on, and what the kernel calls it.

use std::time::Duration;

#[cfg(not(any(target_os = "linux", target_os = "android")))]
use crate::clock::Instant;
use crate::error::{Error, ErrorKind, Result};

/// The kernel's id of the calling thread (`gettid`), as Android's performance hints take it; `None`
/// where there is no such id.
pub fn current_thread_id() -> Option<u32> {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    return u32::try_from(rustix::thread::gettid().as_raw_nonzero().get()).ok();
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    None
}

/// Lets the calling thread run only on the cores of `mask` (bit i: core i).
///
/// # Errors
/// [`ErrorKind::Argument`] for a mask without any core that this process may use, and on systems
/// other than Linux and Android.
pub fn pin_current_thread(mask: u64) -> Result<()> {
    pin(None, mask)
}

/// The same for thread `id`; `None` is the calling one.
pub(super) fn pin(id: Option<u32>, mask: u64) -> Result<()> {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    {
        let set = cores_of(mask);
        let id = id.and_then(|id| rustix::thread::Pid::from_raw(i32::try_from(id).ok()?));
        rustix::thread::sched_setaffinity(id, &set)
            .map_err(|e| refused(mask, format!("{e}; name at least one core that this process may use")))
    }
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    {
        let _ = id;
        Err(refused(mask, "core masks work on Linux and Android only; leave it out".to_owned()))
    }
}

/// The cores of a mask.
#[cfg(any(target_os = "linux", target_os = "android"))]
pub(super) fn cores_of(mask: u64) -> rustix::thread::CpuSet {
    let mut set = rustix::thread::CpuSet::new();
    (0..64).filter(|i| mask >> i & 1 == 1).for_each(|i| set.set(i));
    set
}

/// For how long the calling thread has had a core so far; the time since an arbitrary moment on
/// systems that do not tell.
pub(super) fn time_on_core() -> Duration {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec as u32)
    }
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    {
        static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        START.get_or_init(Instant::now).elapsed()
    }
}

fn refused(mask: u64, why: String) -> Error {
    Error::new(ErrorKind::Argument, format!("core mask {mask:#x}: {why}"))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use rustix::thread::sched_getaffinity;

    #[test]
    fn pins_to_one_core_and_refuses_none() {
        std::thread::spawn(|| {
            let all = sched_getaffinity(None).unwrap();
            let Some(core) = (0..64).find(|&i| all.is_set(i)) else { return };
            pin_current_thread(1 << core).unwrap();
            let now = sched_getaffinity(None).unwrap();
            assert!(now.is_set(core) && now.count() == 1);
            assert_eq!(pin_current_thread(0).unwrap_err().kind(), ErrorKind::Argument);
            assert!(current_thread_id().is_some_and(|id| id > 0));
        })
        .join()
        .unwrap();
    }
}
