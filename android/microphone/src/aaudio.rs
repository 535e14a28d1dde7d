//! AAudio through the `ndk` crate.

use crate::{AudioInput, Counters, Drain, Options, Unavailable, tap};
use ndk::audio::{
    AudioCallbackResult, AudioDirection, AudioError, AudioFormat, AudioInputPreset, AudioPerformanceMode,
    AudioSharingMode, AudioStream, AudioStreamBuilder,
};

/// A running stream.
pub(crate) struct Microphone {
    drain: Drain,
    /// Closed when dropped, after which no callback runs.
    _stream: Stream,
}

struct Stream(#[expect(dead_code, reason = "held to keep the stream open")] AudioStream);

// SAFETY: AAudio lets any thread call and close a stream, one at a time; this one is only held, and
// dropped once.
unsafe impl Send for Stream {}

impl Microphone {
    pub(crate) fn open(options: Options) -> Result<Self, Unavailable> {
        let (mut tap, drain) = tap(options.rate, (options.rate as f32 * options.seconds) as usize);
        let end = tap.end();
        let stream = AudioStreamBuilder::new()
            .map_err(refused)?
            .direction(AudioDirection::Input)
            .input_preset(AudioInputPreset::VoiceCommunication)
            .performance_mode(AudioPerformanceMode::LowLatency)
            .sharing_mode(AudioSharingMode::Shared)
            .format(AudioFormat::PCM_Float)
            .channel_count(1)
            .sample_rate(options.rate as i32)
            .data_callback(Box::new(move |_, data, frames| {
                let count = usize::try_from(frames).unwrap_or(0);
                if !data.is_null() && count > 0 {
                    // SAFETY: AAudio hands over `frames` frames of one float each, for the time of
                    // this call.
                    tap.push(unsafe { std::slice::from_raw_parts(data.cast_const().cast::<f32>(), count) });
                }
                AudioCallbackResult::Continue
            }))
            .error_callback(Box::new(move |_, _| end.set()))
            .open_stream()
            .map_err(refused)?;
        let rate =
            u32::try_from(stream.sample_rate()).map_err(|_| Unavailable::new("the device gives no sample rate"))?;
        if stream.channel_count() != 1 || stream.format() != AudioFormat::PCM_Float {
            return Err(Unavailable::new("the device gives no mono floats"));
        }
        stream.request_start().map_err(refused)?;
        Ok(Self { drain: drain.with_rate(rate), _stream: Stream(stream) })
    }
}

impl AudioInput for Microphone {
    fn rate(&self) -> u32 {
        self.drain.rate()
    }

    fn read(&mut self, out: &mut [f32]) -> usize {
        self.drain.read(out)
    }

    fn counters(&self) -> Counters {
        self.drain.counters()
    }
}

fn refused(e: AudioError) -> Unavailable {
    Unavailable::new(format!("AAudio says {e:?} (is RECORD_AUDIO granted?)"))
}
