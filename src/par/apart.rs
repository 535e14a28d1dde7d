//! A helper thread kept off the core that its caller is on.
//!
//! A scheduler may wake a thread on its waker's core even beside an idle one (Linux does so two
//! times of three on a machine of two cores), and leave both there until its next tick,
//! milliseconds later. So before the caller wakes the helper, the caller's core is taken out of
//! those that the helper may use.

#[cfg(any(target_os = "linux", target_os = "android"))]
pub(super) use linux::Apart;
#[cfg(not(any(target_os = "linux", target_os = "android")))]
pub(super) use other::Apart;

#[cfg(any(target_os = "linux", target_os = "android"))]
mod linux {
    use crate::error::Result;
    use crate::par::cores::{cores_of, pin};
    use rustix::thread::{CpuSet, Pid, sched_getaffinity, sched_getcpu, sched_setaffinity};

    /// Where the helper may run.
    #[derive(Debug)]
    pub(in crate::par) struct Apart {
        id: Option<u32>,
        /// What the host chose for it; else it may run wherever the caller may.
        chosen: Option<CpuSet>,
        /// The caller's core, and the cores that it was taken out of, last time.
        last: Option<(CpuSet, usize)>,
    }

    impl Apart {
        /// For the thread that the kernel calls `id`.
        pub(in crate::par) fn new(id: Option<u32>) -> Self {
            Self { id, chosen: None, last: None }
        }

        /// From here on the helper runs on cores of `mask` only.
        pub(in crate::par) fn choose(&mut self, mask: u64) -> Result<()> {
            pin(self.id, mask)?;
            (self.chosen, self.last) = (Some(cores_of(mask)), None);
            Ok(())
        }

        /// Takes the calling thread's core out of the helper's, unless it has no other.
        ///
        /// Two system calls that read, and one that writes when the caller is on another core than
        /// last time.
        pub(in crate::par) fn keep(&mut self) {
            let Some(id) = self.id.and_then(|id| Pid::from_raw(i32::try_from(id).ok()?)) else { return };
            let Some(all) = self.chosen.or_else(|| sched_getaffinity(None).ok()) else { return };
            let core = sched_getcpu();
            if self.last == Some((all, core)) {
                return;
            }
            self.last = Some((all, core));
            let mut rest = all;
            if core < CpuSet::MAX_CPU {
                rest.unset(core);
            }
            // Where it fails, as when a caller that is pinned to one core leaves none, the helper
            // stays where it may be.
            if rest.count() > 0 {
                let _ = sched_setaffinity(Some(id), &rest);
            }
        }
    }
}

#[cfg(not(any(target_os = "linux", target_os = "android")))]
mod other {
    use crate::error::Result;
    use crate::par::cores::pin;

    /// Nothing to be done here.
    #[derive(Debug)]
    pub(in crate::par) struct Apart(Option<u32>);

    impl Apart {
        pub(in crate::par) fn new(id: Option<u32>) -> Self {
            Self(id)
        }

        pub(in crate::par) fn choose(&mut self, mask: u64) -> Result<()> {
            pin(self.0, mask)
        }

        pub(in crate::par) fn keep(&mut self) {}
    }
}
