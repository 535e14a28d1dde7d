//! What turns pushed sound into sound of the line, for one thread at a time.

use super::line::Line;
use super::resample::Resampler;
use crate::error::Result;

/// What turns pushed sound into sound of the line.
#[derive(Default)]
pub(super) struct Feed {
    resampler: Option<Resampler>,
    /// Made ahead for a rate that is to come.
    pub(super) spare: Option<Resampler>,
}

/// What may be asked of a voice, in order with its sound.
#[derive(Debug, Clone, Copy)]
pub(super) enum Command {
    Finish,
    Clear,
    Present(bool),
    Begin,
}

impl Command {
    /// Rates are below 2^18.
    pub(super) const FIRST: u64 = 1 << 32;

    pub(super) fn word(self) -> u64 {
        Self::FIRST
            + match self {
                Self::Finish => 0,
                Self::Clear => 1,
                Self::Present(present) => 2 + u64::from(present),
                Self::Begin => 4,
            }
    }

    pub(super) fn of(word: u64) -> Self {
        match word - Self::FIRST {
            0 => Self::Finish,
            1 => Self::Clear,
            2 => Self::Present(false),
            3 => Self::Present(true),
            _ => Self::Begin,
        }
    }
}

impl Feed {
    /// Appends clean samples of a rate that is allowed.
    pub(super) fn push(&mut self, line: &Line, samples: &[f32], rate: u32) -> Result<()> {
        if self.resampler.as_ref().is_none_or(|r| r.rate() != rate) {
            let next = match self.spare.take_if(|spare| spare.rate() == rate) {
                Some(spare) => spare,
                None => Resampler::new(rate)?,
            };
            self.finish(line);
            self.resampler = Some(next);
        }
        if let Some(resampler) = &mut self.resampler {
            let more = resampler.latency_samples().saturating_sub(line.lag());
            line.set_lag(line.lag() + more);
            line.push_silence(more);
            resampler.push(samples, |s| line.push(s));
        }
        line.set_present(true);
        Ok(())
    }

    fn finish(&mut self, line: &Line) {
        if let Some(resampler) = &mut self.resampler {
            resampler.finish(|s| line.push(s));
        }
    }

    pub(super) fn obey(&mut self, line: &Line, command: Command) {
        match command {
            Command::Finish => self.finish(line),
            Command::Clear => self.clear(line),
            Command::Present(present) => {
                if !present {
                    self.clear(line);
                }
                line.set_present(present);
            }
            Command::Begin => {
                line.set_lag(0);
                if let Some(resampler) = &mut self.resampler {
                    resampler.reset();
                }
            }
        }
    }

    fn clear(&mut self, line: &Line) {
        line.clear();
        if let Some(resampler) = &mut self.resampler {
            resampler.reset();
        }
    }
}
