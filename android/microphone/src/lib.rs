//! The user's voice from a microphone, for an agent that talks through a loudspeaker next to it.
//!
//! ```text
//! audio thread: callback -> Tap -> lock-free ring -> AudioInput::read :application's thread
//! ```
//!
//! The callback copies into a ring and counts what does not fit: it allocates nothing, takes no
//! lock and makes no system call. Streams ask for the *voice communication* preset, with which
//! Android cancels the echo of what the device plays, so that the agent does not hear itself.
//!
//! A microphone is optional. Where there is none, the permission is missing or the platform
//! refuses, [`open`] says so with an [`Unavailable`]; the session then runs without the user's
//! voice, which is a state that the model knows.
//!
//! | backend | when |
//! |---|---|
//! | [AAudio](https://developer.android.com/ndk/guides/audio/aaudio/aaudio) through the `ndk` crate | Android |
//! | oboe | Android, feature `oboe` |
//! | none | elsewhere: [`open`] is always [`Unavailable`] |

#[cfg(all(target_os = "android", not(feature = "oboe")))]
mod aaudio;
#[cfg(all(target_os = "android", feature = "oboe"))]
mod oboe;
mod tap;

pub use tap::{Drain, End, Tap, tap};

/// A stream of mono sound.
pub trait AudioInput: Send {
    /// Samples a second, Hz.
    fn rate(&self) -> u32;

    /// Moves what was captured since the last call into `out`, oldest first, as far as there is
    /// room; returns how many samples. Never waits.
    fn read(&mut self, out: &mut [f32]) -> usize;

    /// Counters since the stream was opened.
    fn counters(&self) -> Counters;
}

/// What became of the sound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Samples that the callback was given.
    pub captured: u64,
    /// Of these, dropped because nobody had read for [`Options::seconds`].
    pub dropped: u64,
    /// Whether the stream has ended by itself: device unplugged, microphone taken away. Open
    /// another.
    pub ended: bool,
}

/// What to ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Samples a second, Hz; the device may give another rate.
    pub rate: u32,
    /// Seconds that the ring holds between two reads, 0.1 to 60.
    pub seconds: f32,
}

impl Default for Options {
    /// 48 kHz, which devices give without resampling, and two seconds.
    fn default() -> Self {
        Self { rate: 48_000, seconds: 2.0 }
    }
}

/// Why there is no microphone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unavailable {
    reason: String,
}

impl std::fmt::Display for Unavailable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "no microphone: {}; go on without the user's voice", self.reason)
    }
}

impl std::error::Error for Unavailable {}

impl Unavailable {
    /// With its reason.
    pub fn new(reason: impl Into<String>) -> Self {
        Self { reason: reason.into() }
    }
}

/// Opens and starts the platform's microphone.
///
/// # Errors
/// [`Unavailable`] where there is none: no such device, no `RECORD_AUDIO` permission, refused by
/// the platform, not Android; also for options out of range.
pub fn open(options: Options) -> Result<Box<dyn AudioInput>, Unavailable> {
    if !(8_000..=192_000).contains(&options.rate) || !(0.1..=60.0).contains(&options.seconds) {
        let Options { rate, seconds } = options;
        return Err(Unavailable::new(format!("{rate} Hz and {seconds} s: 8000 to 192000 Hz, 0.1 to 60 s")));
    }
    #[cfg(all(target_os = "android", not(feature = "oboe")))]
    return Ok(Box::new(aaudio::Microphone::open(options)?));
    #[cfg(all(target_os = "android", feature = "oboe"))]
    return Ok(Box::new(oboe::Microphone::open(options)?));
    #[cfg(not(target_os = "android"))]
    Err(Unavailable::new("this build captures sound on Android only"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absence_is_an_error_that_tells_how_to_go_on() {
        let Err(e) = open(Options::default()) else { panic!("there is no microphone here") };
        assert!(e.to_string().ends_with("go on without the user's voice"), "{e}");
        let Err(e) = open(Options { rate: 0, ..Options::default() }) else { panic!("0 Hz") };
        assert!(e.to_string().contains("8000 to 192000"), "{e}");
        assert!(open(Options { seconds: f32::NAN, ..Options::default() }).is_err());
    }
}
