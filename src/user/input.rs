//! The end of the head's track that is pushed into, from any thread.

use super::track::{CAPACITY, Fault, fault};
use super::{HeadTrack, TrackStats};
use crate::queue::Queue;
use glam::{Quat, Vec3};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

/// Words of a sample: time; pairs of x, y, z, the rotation's x, y, z, w, all zeros where there is
/// none; and zero.
const WORDS: usize = 5;
/// Attempts to make room before a sample is given up: more than that many other threads are at it.
const ATTEMPTS: usize = 8;

/// The input of the user's head: tells where it is, from any thread.
///
/// Also while the session computes a block: nothing here waits or allocates. A block knows what was
/// pushed before its poll began. Samples are put in order by their time stamps, whichever thread
/// they come from: the same samples give the same bits. Up to 8192 (68 s at 120 Hz) wait for the
/// next poll; beyond that the oldest are dropped and counted
/// ([`TrackStats::overwritten`](super::TrackStats::overwritten)).
#[derive(Clone)]
pub struct HeadInput {
    shared: Arc<Shared>,
}

struct Shared {
    samples: Queue<WORDS>,
    non_finite: AtomicU64,
    absurd: AtomicU64,
    dropped: AtomicU64,
}

impl HeadInput {
    pub(crate) fn new() -> Self {
        let [non_finite, absurd, dropped] = [const { AtomicU64::new(0) }; 3];
        Self { shared: Arc::new(Shared { samples: Queue::new(CAPACITY), non_finite, absurd, dropped }) }
    }

    /// Tells where the head is (midpoint of the eyes), world metres, at `time` seconds of session
    /// time.
    ///
    /// Any rate and any order: a sample is in time as long as no block has used one that is not
    /// earlier, and so as long as no poll came in between. Samples that are late, not finite, or
    /// impossible are ignored and counted ([`super::TrackStats`]).
    pub fn push(&self, position: Vec3, time: f64) {
        self.push_pose(position, None, time);
    }

    /// As [`HeadInput::push`], with the head's rotation (a quaternion of about unit length;
    /// identity: facing +Z) where it is known. Generators that do not look at rotations make the
    /// same motion with and without.
    pub fn push_pose(&self, position: Vec3, rotation: Option<Quat>, time: f64) {
        let Shared { samples, non_finite, absurd, dropped } = &*self.shared;
        let count = |counter: &AtomicU64| _ = counter.fetch_add(1, Relaxed);
        match fault(position, rotation, time) {
            Some(Fault::NonFinite) => return count(non_finite),
            Some(Fault::Absurd) => return count(absurd),
            None => {}
        }
        let ([x, y, z], [a, b, c, d]) = (position.to_array(), rotation.map_or([0.0; 4], |r| r.to_array()));
        let pair = |low: f32, high: f32| u64::from(low.to_bits()) | u64::from(high.to_bits()) << 32;
        let sample = [time.to_bits(), pair(x, y), pair(z, a), pair(b, c), pair(d, 0.0)];
        for _ in 0..ATTEMPTS {
            if samples.push(&sample) {
                return;
            }
            // The newest matter most.
            if samples.pop(&mut [0; WORDS]) {
                count(dropped);
            }
        }
        count(dropped);
    }

    /// As [`HeadInput::push_pose`] of plain numbers: x, y and z, and the rotation's x, y, z and w.
    /// For languages that have no vectors.
    pub fn push_numbers(&self, [x, y, z, qx, qy, qz, qw]: [f32; 7], time: f64) {
        self.push_pose(Vec3::new(x, y, z), Some(Quat::from_xyzw(qx, qy, qz, qw)), time);
    }

    /// Moves what was pushed into `track`; returns at the latest after as many samples as wait at
    /// once.
    pub(crate) fn drain(&self, track: &mut HeadTrack) {
        let mut sample = [0; WORDS];
        for _ in 0..CAPACITY {
            if !self.shared.samples.pop(&mut sample) {
                break;
            }
            let [time, pairs @ ..] = sample;
            let [[x, y], [z, a], [b, c], [d, _]] =
                pairs.map(|pair| [pair as u32, (pair >> 32) as u32].map(f32::from_bits));
            // Zeros are no rotation: what was pushed has a length.
            let rotation = Some(Quat::from_xyzw(a, b, c, d)).filter(|r| r.length_squared() > 0.0);
            track.push_pose(Vec3::new(x, y, z), rotation, f64::from_bits(time));
        }
    }

    /// Counters of a track, and of what did not get there. What waits for the next poll is in none
    /// of them.
    pub(crate) fn stats(&self, track: &HeadTrack) -> TrackStats {
        let (mut stats, Shared { non_finite, absurd, dropped, .. }) = (track.stats(), &*self.shared);
        stats.non_finite += non_finite.load(Relaxed);
        stats.absurd += absurd.load(Relaxed);
        stats.overwritten += dropped.load(Relaxed);
        stats
    }

    /// Drops what was pushed, and counts from zero.
    pub(crate) fn reset(&self) {
        self.drain(&mut HeadTrack::with_capacity(2));
        let Shared { non_finite, absurd, dropped, .. } = &*self.shared;
        [non_finite, absurd, dropped].into_iter().for_each(|counter| counter.store(0, Relaxed));
    }
}

impl std::fmt::Debug for HeadInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("HeadInput").field("room", &self.shared.samples.room()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::user::Presence;

    const AT: Vec3 = Vec3::new(0.0, 1.6, 2.0);

    #[test]
    fn rotations_get_through() {
        let (input, mut t) = (HeadInput::new(), HeadTrack::new());
        let turned = Quat::from_rotation_x(0.3);
        input.push_pose(AT, Some(turned), 0.0);
        input.push_pose(AT, None, 0.1);
        input.push_pose(AT, Some(Quat::NAN), 0.2);
        input.drain(&mut t);
        assert_eq!([0.0, 0.1].map(|time| t.sample(time, 1.0).rotation), [Some(turned.normalize()), None]);
        assert_eq!(input.stats(&t), TrackStats { accepted: 2, non_finite: 1, ..Default::default() });
    }

    #[test]
    fn an_input_may_be_pushed_into_from_several_threads() {
        let input = HeadInput::new();
        std::thread::scope(|scope| {
            for thread in 0..4u32 {
                let input = input.clone();
                scope.spawn(move || (0..500).for_each(|i| input.push(AT, f64::from(4 * i + thread) * 0.01)));
            }
        });
        let mut t = HeadTrack::new();
        input.drain(&mut t);
        assert_eq!(t.stats(), TrackStats { accepted: 2_000, ..Default::default() });
        assert_eq!(t.sample(19.985, 20.0).presence, Presence::Measured);
        // Nobody polls: the newest stay.
        (0..9_000).for_each(|i| input.push(AT, 20.0 + f64::from(i) * 0.01));
        let mut t = HeadTrack::new();
        input.drain(&mut t);
        assert_eq!(t.stats().accepted, 8_192);
        input.push(Vec3::NAN, 1.0);
        input.push(AT, 1e9);
        let want = TrackStats { accepted: 8_192, overwritten: 808, non_finite: 1, absurd: 1, ..Default::default() };
        assert_eq!(input.stats(&t), want);
        input.push(AT, 1.0);
        input.reset();
        input.drain(&mut t);
        assert_eq!(input.stats(&t), TrackStats { accepted: 8_192, ..Default::default() });
        assert_eq!([28.07, 109.99].map(|time| t.sample(time, 200.0).presence), [Presence::Absent, Presence::Measured]);
    }
}
