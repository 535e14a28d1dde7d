//! oboe: AAudio, or OpenSL ES where AAudio misbehaves, with the quirks of devices worked around.

use crate::tap::End;
use crate::{AudioInput, Counters, Drain, Options, Tap, Unavailable, tap};
use ::oboe::{
    AudioInputCallback, AudioInputStreamSafe, AudioStream, AudioStreamAsync, AudioStreamBase, AudioStreamBuilder,
    DataCallbackResult, Error, Input, InputPreset, Mono, PerformanceMode, SharingMode,
};

/// A running stream.
pub(crate) struct Microphone {
    drain: Drain,
    stream: AudioStreamAsync<Input, Callback>,
}

struct Callback {
    tap: Tap,
    end: End,
}

impl AudioInputCallback for Callback {
    type FrameType = (f32, Mono);

    fn on_audio_ready(&mut self, _: &mut dyn AudioInputStreamSafe, samples: &[f32]) -> DataCallbackResult {
        self.tap.push(samples);
        DataCallbackResult::Continue
    }

    fn on_error_before_close(&mut self, _: &mut dyn AudioInputStreamSafe, _: Error) {
        self.end.set();
    }
}

impl Microphone {
    pub(crate) fn open(options: Options) -> Result<Self, Unavailable> {
        let (tap, drain) = tap(options.rate, (options.rate as f32 * options.seconds) as usize);
        let end = tap.end();
        let mut stream = AudioStreamBuilder::default()
            .set_input()
            .set_input_preset(InputPreset::VoiceCommunication)
            .set_performance_mode(PerformanceMode::LowLatency)
            .set_sharing_mode(SharingMode::Shared)
            .set_sample_rate(options.rate as i32)
            .set_format::<f32>()
            .set_channel_count::<Mono>()
            .set_callback(Callback { tap, end })
            .open_stream()
            .map_err(refused)?;
        let rate =
            u32::try_from(stream.get_sample_rate()).map_err(|_| Unavailable::new("the device gives no sample rate"))?;
        stream.start().map_err(refused)?;
        Ok(Self { drain: drain.with_rate(rate), stream })
    }
}

impl Drop for Microphone {
    fn drop(&mut self) {
        // Closing follows; a stream that cannot be stopped has ended already.
        let _ = self.stream.stop();
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

fn refused(e: Error) -> Unavailable {
    Unavailable::new(format!("oboe says {e:?} (is RECORD_AUDIO granted?)"))
}
