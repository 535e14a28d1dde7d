//! Streaming conversion of any sample rate to 24 kHz: windowed-sinc interpolation by rubato.
//!
//! A sample between input samples is a weighted sum of its neighbours on both sides, so output `n`,
//! which stands for the input at time `n / 24000` s, needs input that comes up to
//! [`Resampler::latency`] later. Input goes to rubato in pieces whose length depends on the
//! position in the stream alone, never on how the caller cut it: any chunking gives the same bits.
//!
//! rubato starts at a fraction of an output sample. With `L` filter taps, `f` stored phases and `t
//! = rate / 24000` input samples per output sample, its first output is centred on input `-L/2 +
//! 1/f + t_0`, where `t_0` is its first step. The first step is chosen so that this is `-m t` for a
//! whole `m`: dropping `m` outputs leaves one exactly at input 0.
//!
//! rubato sums in an order that depends on the CPU, and its filter on the platform's sine. So it
//! runs in f64 and what comes out is rounded to multiples of 2^-20 (-120 dB): the same bits
//! everywhere, but for a sample in some 10^9 that falls within an f64 error of the middle between
//! two.

use crate::error::{Error, ErrorKind, Result};
use crate::frame::SAMPLE_RATE;
use rubato::audioadapter_buffers::direct::SequentialSlice;
use rubato::{
    Adjustable, Async, FixedAsync, Resampler as _, Resizable, SincInterpolationParameters, SincInterpolationType,
    WindowFunction, calculate_cutoff,
};

/// Lowest input rate, Hz.
pub const MIN_RATE: u32 = 8_000;
/// Highest input rate, Hz.
pub const MAX_RATE: u32 = 192_000;

/// Filter taps at the lower of the two rates; half of them look ahead.
const TAPS: usize = 64;
/// Stored phases of the filter; cubic interpolation in between.
const PHASES: usize = 128;
/// Output samples computed at once.
const CHUNK: usize = 8;
const WINDOW: WindowFunction = WindowFunction::BlackmanHarris;
/// What comes out is a whole number of these, exact in f32 below 16 times full scale.
const STEPS: f64 = (1 << 20) as f64;

/// Refuses rates outside [`MIN_RATE`] to [`MAX_RATE`].
pub fn check_rate(rate: u32) -> Result<()> {
    if (MIN_RATE..=MAX_RATE).contains(&rate) {
        return Ok(());
    }
    let message =
        format!("a sample rate of {rate} Hz is outside {MIN_RATE} to {MAX_RATE} Hz; resample the sound first");
    Err(Error::new(ErrorKind::Audio, message))
}

/// Converts a mono stream of one rate to 24 kHz. Input at 24 kHz passes untouched and at once.
///
/// Memory is allocated by [`Resampler::new`] only and does not grow.
pub struct Resampler {
    rate: u32,
    /// `None` at 24 kHz.
    sinc: Option<Box<Sinc>>,
}

impl Resampler {
    /// A resampler from `rate` (Hz, 8000 to 192000).
    ///
    /// # Errors
    /// [`ErrorKind::Audio`] for a rate outside that range.
    pub fn new(rate: u32) -> Result<Self> {
        check_rate(rate)?;
        let sinc = if rate == SAMPLE_RATE { None } else { Some(Box::new(Sinc::new(rate)?)) };
        Ok(Self { rate, sinc })
    }

    /// Input rate, Hz.
    pub fn rate(&self) -> u32 {
        self.rate
    }

    /// Most output samples (24 kHz) by which what came out can lag what was pushed: after `i` input
    /// samples at least `floor(i * 24000 / rate) - latency_samples()` have come out. 0 at 24 kHz,
    /// else 41 or 42 from 22.9 kHz up, 58 at 16 kHz, 107 at 8 kHz.
    pub fn latency_samples(&self) -> usize {
        self.sinc.as_ref().map_or(0, |s| s.latency)
    }

    /// Converts `input` and hands what is ready to `out`, in order, in pieces. `input` must be
    /// finite.
    pub fn push(&mut self, input: &[f32], mut out: impl FnMut(&[f32])) {
        match &mut self.sinc {
            None => out(input),
            Some(sinc) => sinc.push(input, &mut out),
        }
    }

    /// Ends the stream: hands out what is still inside, as if silence followed, so that `ceil(i *
    /// 24000 / rate)` samples have come out for `i` that went in. The next push starts a new
    /// stream.
    pub fn finish(&mut self, mut out: impl FnMut(&[f32])) {
        if let Some(sinc) = &mut self.sinc {
            sinc.finish(&mut out);
        }
    }

    /// Forgets what is inside and starts a new stream.
    pub fn reset(&mut self) {
        if let Some(sinc) = &mut self.sinc {
            sinc.reset();
        }
    }
}

/// The whole of `samples` (mono, `rate` Hz, finite) at 24 kHz: `ceil(len * 24000 / rate)` samples,
/// sample `n` at time `n / 24000` s.
///
/// # Errors
/// [`ErrorKind::Audio`] for a rate outside 8 to 192 kHz.
#[cfg(feature = "internals")]
pub fn resample_to_24k(samples: &[f32], rate: u32) -> Result<Vec<f32>> {
    let mut resampler = Resampler::new(rate)?;
    let mut out = Vec::with_capacity(outputs(samples.len() as u64, rate) as usize);
    resampler.push(samples, |s| out.extend_from_slice(s));
    resampler.finish(|s| out.extend_from_slice(s));
    Ok(out)
}

/// Output samples that begin within `inputs` input samples.
fn outputs(inputs: u64, rate: u32) -> u64 {
    (inputs * u64::from(SAMPLE_RATE)).div_ceil(u64::from(rate))
}

struct Sinc {
    inner: Async<f64>,
    rate: u32,
    /// Input waiting for rubato; the first `filled` samples are valid.
    input: Vec<f64>,
    filled: usize,
    output: [f64; CHUNK],
    /// First step, input samples, and outputs to drop after it.
    first_step: f64,
    lead: usize,
    latency: usize,
    /// Whether the first step has been made; then the outputs that are still to be dropped.
    started: bool,
    drop: usize,
    /// Input samples of this stream, and output samples handed out.
    pushed: u64,
    given: u64,
}

impl Sinc {
    fn new(rate: u32) -> Result<Self> {
        let step = f64::from(rate) / f64::from(SAMPLE_RATE);
        let taps = (TAPS as f64 * step.max(1.0)).ceil() as usize;
        let taps = taps.next_multiple_of(8);
        let params = SincInterpolationParameters::new(taps, WINDOW)
            .f_cutoff(calculate_cutoff(TAPS, WINDOW))
            .oversampling_factor(PHASES)
            .interpolation(SincInterpolationType::Cubic);
        let inner = Async::new_sinc(1.0 / step, 2.0, &params, CHUNK, 1, FixedAsync::Output)
            .map_err(|e| Error::new(ErrorKind::Audio, format!("cannot resample from {rate} Hz: {e}")))?;
        let centre = taps as f64 / 2.0 - 1.0 / PHASES as f64;
        // 0.5 to 1.5 steps, inside the relative range of 2 asked of rubato.
        let lead = (centre / step - 0.5).floor();
        let mut sinc = Self {
            input: vec![0.0; inner.input_frames_max() + taps],
            inner,
            rate,
            filled: 0,
            output: [0.0; CHUNK],
            first_step: centre - lead * step,
            lead: lead as usize,
            latency: ((taps as f64 / 2.0 + 1.0) / step).ceil() as usize + CHUNK,
            started: false,
            drop: 0,
            pushed: 0,
            given: 0,
        };
        sinc.reset();
        Ok(sinc)
    }

    fn reset(&mut self) {
        self.inner.reset();
        self.set_step(1, self.first_step);
        (self.filled, self.started, self.drop, self.pushed, self.given) = (0, false, self.lead, 0, 0);
    }

    fn set_step(&mut self, chunk: usize, step: f64) {
        let done = self.inner.set_chunk_size(chunk).and_then(|()| self.inner.set_resample_ratio(1.0 / step, false));
        debug_assert!(done.is_ok(), "{done:?}");
    }

    fn push(&mut self, mut input: &[f32], out: &mut dyn FnMut(&[f32])) {
        self.pushed += input.len() as u64;
        loop {
            let need = self.inner.input_frames_next();
            let take = need.saturating_sub(self.filled).min(input.len());
            let (now, later) = input.split_at(take);
            let room = &mut self.input[self.filled..self.filled + take];
            room.iter_mut().zip(now).for_each(|(to, s)| *to = f64::from(*s));
            self.filled += take;
            input = later;
            if self.filled < need {
                return;
            }
            self.step(out);
        }
    }

    /// One call of rubato; the input it needs is there.
    fn step(&mut self, out: &mut dyn FnMut(&[f32])) {
        let filled = self.filled;
        let made = SequentialSlice::new(&self.input[..filled], 1, filled).and_then(|input| {
            let mut output = SequentialSlice::new_mut(&mut self.output, 1, CHUNK)?;
            Ok(self.inner.process_into_buffer(&input, &mut output, None))
        });
        let Ok(Ok((_, made))) = made else {
            unreachable!("buffers are sized by rubato's own counts: {made:?}");
        };
        self.filled = 0;
        if !self.started {
            self.started = true;
            self.set_step(CHUNK, f64::from(self.rate) / f64::from(SAMPLE_RATE));
        }
        let skip = self.drop.min(made);
        self.drop -= skip;
        if skip < made {
            self.given += (made - skip) as u64;
            out(&self.output.map(|s| ((s * STEPS).round() / STEPS) as f32)[skip..made]);
        }
    }

    fn finish(&mut self, out: &mut dyn FnMut(&[f32])) {
        let total = outputs(self.pushed, self.rate);
        let mut left = total.saturating_sub(self.given) as usize;
        let mut cut = |piece: &[f32]| {
            let take = piece.len().min(left);
            left -= take;
            if take > 0 {
                out(&piece[..take]);
            }
        };
        while self.given < total {
            let need = self.inner.input_frames_next();
            self.input[self.filled..need].fill(0.0);
            self.filled = need;
            self.step(&mut cut);
        }
        self.reset();
    }
}
