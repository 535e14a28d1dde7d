//! The user's head as it comes from a tracker, at the times the model asks for.

use super::{HOLD_SECONDS, MAX_DISTANCE, TELEPORT_SPEED};
use crate::frame::{BLOCK_FRAMES, FPS};
use glam::{Quat, Vec3};
use std::collections::VecDeque;

/// Samples that a [`HeadTrack::new`] keeps: 68 s at 120 Hz.
pub(super) const CAPACITY: usize = 8_192;
/// Shortest time that speeds are judged over, s: what a tracker's jitter makes of two close time
/// stamps is no teleport.
const SPEED_TIME: f64 = 1.0 / 120.0;
/// Times further from 0 than this are not believed, s (about 115 days).
const MAX_TIME: f64 = 1e7;

/// How a position is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Presence {
    /// Between two samples, or on one.
    Measured,
    /// The last sample before, at most half a second old.
    Held,
    /// Not known; the position is zero and means nothing.
    #[default]
    Absent,
}

/// Where the user's head is at some time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct UserSample {
    /// How the position is known.
    pub presence: Presence,
    /// Head position in the world, metres; zero when absent.
    pub position: Vec3,
    /// Head rotation in the world (identity: facing +Z), where it is known.
    pub rotation: Option<Quat>,
}

/// What became of the samples that were pushed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TrackStats {
    /// Taken.
    pub accepted: u64,
    /// Ignored: NaN or infinity in the position, the rotation or the time.
    pub non_finite: u64,
    /// Ignored: late (a block has used a sample of that time or of a later one), or at the time of
    /// another sample.
    pub out_of_order: u64,
    /// Ignored: more than 1 km from the origin, a time of more than 10 million seconds, or a
    /// rotation whose length is not within 0.5 to 2.
    pub absurd: u64,
    /// Taken, but too far from the sample before to have walked there; the way between is not
    /// filled in.
    pub teleports: u64,
    /// Dropped to make room before they were asked for.
    pub overwritten: u64,
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    time: f64,
    position: Vec3,
    rotation: Option<Quat>,
    /// Not reached by walking from the sample before.
    jump: bool,
}

impl Sample {
    fn known(&self, presence: Presence) -> UserSample {
        UserSample { presence, position: self.position, rotation: self.rotation }
    }
}

/// Why a sample is of no use, whatever came before it.
pub(super) enum Fault {
    NonFinite,
    Absurd,
}

pub(super) fn fault(position: Vec3, rotation: Option<Quat>, time: f64) -> Option<Fault> {
    if !position.is_finite() || !time.is_finite() || rotation.is_some_and(|r| !r.is_finite()) {
        return Some(Fault::NonFinite);
    }
    // Squares of absurd positions overflow to infinity, which is refused as well.
    let turned = rotation.is_none_or(|r| (0.25..=4.0).contains(&r.length_squared()));
    let absurd = position.length_squared() > MAX_DISTANCE * MAX_DISTANCE || time.abs() > MAX_TIME || !turned;
    absurd.then_some(Fault::Absurd)
}

/// Timed head positions. Bounded; allocates when made and never after.
///
/// Causal: the answer for a frame depends on samples with `time <= now` only, so pushing a whole
/// recording ahead of time gives what live tracking gives. Samples may come in any order as long as
/// none was used that is not earlier: what stands is sorted by time.
#[derive(Debug)]
pub struct HeadTrack {
    /// In order of time.
    samples: VecDeque<Sample>,
    capacity: usize,
    /// Latest `now` that was asked for.
    asked: f64,
    /// Time of the last sample that an answer knew.
    used: f64,
    stats: TrackStats,
}

impl HeadTrack {
    /// An empty track for the last 8192 samples (68 s at 120 Hz).
    pub fn new() -> Self {
        Self::with_capacity(CAPACITY)
    }

    /// An empty track for the last `samples` samples (at least 2).
    pub fn with_capacity(samples: usize) -> Self {
        let capacity = samples.max(2);
        Self {
            samples: VecDeque::with_capacity(capacity),
            capacity,
            asked: f64::NEG_INFINITY,
            used: f64::NEG_INFINITY,
            stats: TrackStats::default(),
        }
    }

    /// Adds a head position (world, metres, within 1 km) at `time` (session time, seconds), which
    /// is later than all samples that were used and is no other sample's. What does not fit that is
    /// ignored and counted, see [`TrackStats`].
    #[cfg_attr(not(feature = "internals"), allow(dead_code, reason = "sessions push poses"))]
    pub fn push(&mut self, position: Vec3, time: f64) {
        self.push_pose(position, None, time);
    }

    /// As [`HeadTrack::push`], with the head's rotation where it is known: any quaternion of about
    /// unit length.
    pub fn push_pose(&mut self, position: Vec3, rotation: Option<Quat>, time: f64) {
        match fault(position, rotation, time) {
            Some(Fault::NonFinite) => return self.stats.non_finite += 1,
            Some(Fault::Absurd) => return self.stats.absurd += 1,
            None => {}
        }
        let mut at = self.samples.len();
        if self.samples.back().is_some_and(|last| time <= last.time) {
            at = self.samples.partition_point(|s| s.time < time);
            if time <= self.used || self.samples[at].time == time {
                self.stats.out_of_order += 1;
                return;
            }
        }
        if self.samples.len() == self.capacity {
            if at == 0 {
                // Older than all that there is room for.
                self.stats.overwritten += 1;
                return;
            }
            // The oldest is used up once the sample after it may be the answer.
            if self.samples[1].time > self.asked {
                self.stats.overwritten += 1;
            }
            self.samples.pop_front();
            at -= 1;
        }
        self.stats.accepted += 1;
        let rotation = rotation.map(Quat::normalize);
        self.samples.insert(at, Sample { time, position, rotation, jump: false });
        self.judge(at);
        self.judge(at + 1);
    }

    /// Judges whether the user can have walked to sample `at` from the one before.
    fn judge(&mut self, at: usize) {
        let (Some(before), Some(&sample)) = (at.checked_sub(1).map(|i| self.samples[i]), self.samples.get(at)) else {
            return;
        };
        let reach = TELEPORT_SPEED * (sample.time - before.time).max(SPEED_TIME) as f32;
        let jump = sample.position.distance_squared(before.position) > reach * reach;
        self.stats.teleports = self.stats.teleports + u64::from(jump) - u64::from(sample.jump);
        self.samples[at].jump = jump;
    }

    /// The head at `time` (session seconds), as known at `now`: linear between neighbours, both no
    /// later than `now`, unless they are more than half a second or a teleport apart; else the last
    /// one before, for half a second. Between a rotation and none there is none.
    pub fn sample(&mut self, time: f64, now: f64) -> UserSample {
        if now > self.asked {
            self.asked = now;
        }
        let known = self.count(|t| t <= self.asked);
        self.used = known.checked_sub(1).map_or(self.used, |last| self.samples[last].time.max(self.used));
        self.peek(time, now)
    }

    fn peek(&self, time: f64, now: f64) -> UserSample {
        let until = time.min(now);
        let after = self.count(|t| t <= until);
        if after == 0 || !time.is_finite() || now.is_nan() {
            return UserSample::default();
        }
        let before = self.samples[after - 1];
        if before.time == time {
            return before.known(Presence::Measured);
        }
        if after < self.samples.len() {
            let next = self.samples[after];
            let gap = next.time - before.time;
            if next.time <= now && gap <= HOLD_SECONDS && !next.jump {
                let part = ((time - before.time) / gap) as f32;
                let position = before.position.lerp(next.position, part);
                let rotation = before.rotation.zip(next.rotation).map(|(a, b)| a.lerp(b, part));
                return UserSample { presence: Presence::Measured, position, rotation };
            }
        }
        if time - before.time <= HOLD_SECONDS {
            return before.known(Presence::Held);
        }
        UserSample::default()
    }

    /// Number of leading samples whose time satisfies `keep`, which holds up to some time.
    fn count(&self, keep: impl Fn(f64) -> bool) -> usize {
        self.samples.partition_point(|s| keep(s.time))
    }

    /// The head in the four frames from `first_frame` on (frame `i` at `i / 30` s), as known at
    /// `now` seconds.
    pub fn block(&mut self, first_frame: u64, now: f64, out: &mut [UserSample; BLOCK_FRAMES]) {
        for (i, sample) in out.iter_mut().enumerate() {
            *sample = self.sample((first_frame + i as u64) as f64 / f64::from(FPS), now);
        }
    }

    /// Counters since the start.
    pub fn stats(&self) -> TrackStats {
        self.stats
    }

    /// Empty, as when new.
    pub fn reset(&mut self) {
        self.samples.clear();
        (self.asked, self.used, self.stats) = (f64::NEG_INFINITY, f64::NEG_INFINITY, TrackStats::default());
    }
}

impl Default for HeadTrack {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
#[path = "track_tests.rs"]
mod tests;
