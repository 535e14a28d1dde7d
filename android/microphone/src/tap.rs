//! From the audio thread to the application's: a ring of samples and two counters.

use crate::{AudioInput, Counters};
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

#[derive(Debug, Default)]
struct Shared {
    captured: AtomicU64,
    dropped: AtomicU64,
    ended: AtomicBool,
}

/// The audio thread's end. [`Tap::push`] allocates nothing, takes no lock and makes no system call.
#[derive(Debug)]
pub struct Tap {
    ring: Producer<f32>,
    shared: Arc<Shared>,
}

/// The application's end.
#[derive(Debug)]
pub struct Drain {
    ring: Consumer<f32>,
    shared: Arc<Shared>,
    rate: u32,
}

/// Says that the stream has ended.
#[derive(Debug, Clone)]
pub struct End(Arc<Shared>);

/// Both ends of a ring that holds `samples` samples of `rate` Hz.
pub fn tap(rate: u32, samples: usize) -> (Tap, Drain) {
    let (producer, consumer) = RingBuffer::new(samples);
    let shared = Arc::new(Shared::default());
    (Tap { ring: producer, shared: Arc::clone(&shared) }, Drain { ring: consumer, shared, rate })
}

impl Tap {
    /// Hands over `samples`; what does not fit is dropped and counted.
    pub fn push(&mut self, samples: &[f32]) {
        let (_, left) = self.ring.push_partial_slice(samples);
        self.shared.captured.fetch_add(samples.len() as u64, Ordering::Relaxed);
        self.shared.dropped.fetch_add(left.len() as u64, Ordering::Relaxed);
    }

    /// What an error callback holds, to say that the stream has ended.
    pub fn end(&self) -> End {
        End(Arc::clone(&self.shared))
    }
}

impl End {
    /// The stream has ended.
    pub fn set(&self) {
        self.0.ended.store(true, Ordering::Relaxed);
    }
}

impl AudioInput for Drain {
    fn rate(&self) -> u32 {
        self.rate
    }

    fn read(&mut self, out: &mut [f32]) -> usize {
        self.ring.pop_partial_slice(out).0.len()
    }

    fn counters(&self) -> Counters {
        Counters {
            captured: self.shared.captured.load(Ordering::Relaxed),
            dropped: self.shared.dropped.load(Ordering::Relaxed),
            ended: self.shared.ended.load(Ordering::Relaxed),
        }
    }
}

impl Drain {
    /// The same with the rate that the device gave.
    #[must_use]
    pub fn with_rate(mut self, rate: u32) -> Self {
        self.rate = rate;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_dropped_and_counted() {
        let (mut tap, mut drain) = tap(48_000, 8);
        let mut out = [0.0; 16];
        assert_eq!(drain.read(&mut out), 0);
        tap.push(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        tap.push(&[6.0, 7.0, 8.0, 9.0, 10.0]);
        assert_eq!(drain.counters(), Counters { captured: 10, dropped: 2, ended: false });
        assert_eq!(drain.read(&mut out[..3]), 3);
        assert_eq!(drain.read(&mut out[3..]), 5);
        assert_eq!(out[..8], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        tap.end().set();
        assert!(drain.counters().ended);
        assert_eq!(drain.with_rate(16_000).rate(), 16_000);
    }

    #[test]
    fn order_is_kept_across_threads() {
        let (mut tap, mut drain) = tap(48_000, 64);
        let total = 20_000u32;
        let writer = std::thread::spawn(move || {
            let mut next = 0;
            while next < total {
                let piece: Vec<f32> = (next..total.min(next + 48)).map(|i| i as f32).collect();
                if tap.ring.slots() < piece.len() {
                    std::thread::yield_now();
                    continue;
                }
                next += piece.len() as u32;
                tap.push(&piece);
            }
        });
        let (mut seen, mut out) = (0u32, [0.0; 50]);
        while seen < total {
            let count = drain.read(&mut out);
            assert!(out[..count].iter().zip(seen..).all(|(a, b)| *a == b as f32));
            seen += count as u32;
        }
        writer.join().unwrap();
        assert_eq!(drain.counters(), Counters { captured: u64::from(total), dropped: 0, ended: false });
    }
}
