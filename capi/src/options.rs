//! Options of a session.

use crate::status::{Failure, Outcome, VisavisStatus, guard};
use crate::structs::{Sized32, check, sized_struct};
use visavis::{Governor, Root, Sampler, SessionOptions};

/// How a block is made: evaluations of the network against quality.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisavisSamplerKind {
    /// Midpoint rule with 1, 2 or 4 steps: two evaluations each. 4 is the reference.
    Midpoint = 0,
    /// Euler's rule with 1 to 64 steps: one evaluation each.
    Euler = 1,
    /// The distilled student: one evaluation, steps are ignored. Needs a bundle that has one.
    Single = 2,
}

/// Options of a session. Fill with visavis_session_options_init, then change what is needed.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct VisavisSessionOptions {
    /// sizeof(visavis_session_options).
    pub struct_size: u32,
    /// Threads that compute a block, 1 (the caller of visavis_session_poll) or 2; the motion is the
    /// same. Default 1.
    pub threads: u32,
    /// Same seed and same inputs: same motion, bit for bit. Default 0.
    pub seed: u64,
    /// Cores that the second thread may run on, bit i for core i; 0 (default): any. Linux and
    /// Android.
    pub core_mask: u64,
    /// A visavis_sampler_kind; default midpoint.
    pub sampler_kind: i32,
    /// Steps of the sampler; default 4.
    pub sampler_steps: u32,
    /// Gaze target, -1 to 1 (0 is averted, 1 sustained eye contact); NaN (default): what comes
    /// naturally.
    pub gaze: f32,
    /// Guidance weight, 0 to 20; NaN (default): the bundle's.
    pub guidance: f32,
    /// Weight of the gaze target, 0 to 20; NaN (default): the bundle's.
    pub gaze_guidance: f32,
    /// Scale of the noise, 0 to 2; less is calmer. NaN (default): the bundle's.
    pub temperature: f32,
    /// Where the agent stands at the start: x and z, metres; heading, radians (0 faces +Z, positive
    /// turns towards +X).
    pub start_x: f64,
    /// See start_x.
    pub start_z: f64,
    /// See start_x.
    pub start_yaw: f64,
    /// Whether planted feet are kept in place; 1 by default.
    pub stance: u32,
    /// Whether frames that no body could show are replaced by a held pose; 1 by default.
    pub guard: u32,
    /// Milliseconds that a block may take, 1 to 133.3: a governor then chooses the sampler of each
    /// block, the session's sampler at best, so that none comes late. 0 (default): the session's
    /// sampler, always.
    pub budget_ms: f32,
    /// 0.
    pub reserved: u32,
    /// Since interface 1.2. Seconds of sound that each voice may be ahead of the block that was
    /// computed last, 0.5 to 60 (default); what is more is dropped and counted. A second takes 192
    /// KB: a crowd that hears sound as it comes does with the least.
    pub voice_ahead: f64,
    /// Since interface 1.3. How much the agent minds sounds in the room: -1 dull, 0 (default)
    /// neutral, 1 sensitive, numbers between and up to 1.5 either way.
    pub sensitivity: f32,
    /// 0.
    pub reserved2: u32,
    /// Of test builds.
    #[cfg(feature = "grown")]
    pub grown: u64,
}

sized_struct!(VisavisSessionOptions, "visavis_session_options", 88);

impl VisavisSessionOptions {
    fn defaults() -> Self {
        Self {
            struct_size: size_of::<Self>() as u32,
            threads: 1,
            seed: 0,
            core_mask: 0,
            sampler_kind: VisavisSamplerKind::Midpoint as i32,
            sampler_steps: 4,
            gaze: f32::NAN,
            guidance: f32::NAN,
            gaze_guidance: f32::NAN,
            temperature: f32::NAN,
            start_x: 0.0,
            start_z: 0.0,
            start_yaw: 0.0,
            stance: 1,
            guard: 1,
            budget_ms: 0.0,
            reserved: 0,
            voice_ahead: SessionOptions::default().voice_ahead,
            sensitivity: 0.0,
            reserved2: 0,
            #[cfg(feature = "grown")]
            grown: crate::structs::GROWN,
        }
    }

    /// Options from C; null for the defaults.
    ///
    /// # Safety
    /// A non-null `options` points to as many bytes as its first field says.
    pub(crate) unsafe fn options(options: *const Self) -> Outcome<SessionOptions> {
        let defaults = Self::defaults();
        // SAFETY: the caller's promise.
        let o = if options.is_null() { defaults } else { unsafe { Self::read(options, defaults) }? };
        #[cfg(feature = "grown")]
        if o.grown != defaults.grown {
            return Err(Failure::argument("grown: its default is what an older caller means"));
        }
        let given = |v: f32| (!v.is_nan()).then_some(v);
        Ok(SessionOptions {
            seed: o.seed,
            threads: o.threads as usize,
            core_mask: (o.core_mask != 0).then_some(o.core_mask),
            sampler: sampler(o.sampler_kind, o.sampler_steps)?,
            gaze: given(o.gaze),
            guidance: given(o.guidance),
            gaze_guidance: given(o.gaze_guidance),
            temperature: given(o.temperature),
            start: Root { x: o.start_x, z: o.start_z, yaw: o.start_yaw },
            stance: o.stance != 0,
            guard: o.guard != 0,
            governor: Governor::within(o.budget_ms),
            voice_ahead: o.voice_ahead,
            sensitivity: o.sensitivity,
            ..Default::default()
        })
    }
}

/// The sampler that `kind` and `steps` stand for.
pub(crate) fn sampler(kind: i32, steps: u32) -> Outcome<Sampler> {
    let count = u8::try_from(steps).ok();
    let sampler = match (kind, count) {
        (0, Some(n)) => Sampler::midpoint(n).ok(),
        (1, Some(n)) => Sampler::euler(n).ok(),
        (2, _) => Some(Sampler::Single),
        _ => None,
    };
    sampler.ok_or_else(|| Failure::argument(format!("sampler {kind} with {steps} steps: see visavis_sampler_kind")))
}

/// `(kind, steps)` of a sampler; kind -1 for one that this interface does not know.
pub(crate) fn sampler_numbers(sampler: Sampler) -> (i32, u32) {
    match sampler {
        Sampler::Single => (VisavisSamplerKind::Single as i32, 1),
        Sampler::Euler(steps) => (VisavisSamplerKind::Euler as i32, u32::from(steps.get())),
        _ if sampler.is_midpoint() => (VisavisSamplerKind::Midpoint as i32, u32::from(sampler.steps())),
        _ => (-1, 0),
    }
}

/// Fills `options` with the defaults; `struct_size` is sizeof(visavis_session_options).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn visavis_session_options_init(
    options: *mut VisavisSessionOptions,
    struct_size: usize,
) -> VisavisStatus {
    guard(|| {
        check(options, "options")?;
        let size = u32::try_from(struct_size).unwrap_or(0);
        if (size as usize) < size_of::<u32>() {
            return Err(Failure::argument("struct_size: pass sizeof(visavis_session_options)"));
        }
        // SAFETY: not null, aligned, room for a u32 by the header's promise.
        unsafe { options.cast::<u32>().write(size) };
        // SAFETY: the header's promise: `options` points to `struct_size` bytes.
        unsafe { VisavisSessionOptions::write(options, &VisavisSessionOptions::defaults()) }
    })
}
