//! Block times in, plans out. No clock, no randomness: the same times give the same plans.

use super::{Budget, GovernorStats, Hold, Plan};
use crate::frame::Sampler;

/// Rungs of the longest ladder.
pub(super) const RUNGS: usize = 5;
/// A block is planned to take at most this share of the budget.
const HEADROOM: f64 = 0.5;
/// A better rung must fit into this share before it is climbed to.
const CLIMB: f64 = 0.4;
/// After holding, the last rung must fit into this share.
const RETURN: f64 = 0.8;
/// Blocks over which the slowest one counts, 2 s.
const MEMORY: usize = 15;
/// Blocks without a change before a climb, 2 s at first, and at most (a minute).
const WAIT: [u32; 2] = [15, 450];
/// A climb that is taken back within so many blocks, 15 s, was a mistake.
const TRIAL: u32 = 112;
/// Late blocks of the last rung in a row after which motion is held: one stall is not enough.
const LATE: u32 = 3;
/// Blocks from one rehearsal to the next while motion is held, at first and at most, 1 s and 8.5 s.
const REHEARSE: [u32; 2] = [8, 64];
/// Passes for catching up in one block, at most.
const PASSES: u8 = 4;
/// A slot of a cheaper rung is brought up to date when it lacks so many tokens, which one pass
/// does.
const BEHIND: u64 = 7;

/// What the next block would cost, in units of work; rungs as on the ladder, best first.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(in crate::session) struct Outlook {
    /// Each rung with its slots up to date, and as they are.
    pub(in crate::session) rungs: [[f64; 2]; RUNGS],
    /// Most tokens that a slot of each rung lacks.
    pub(in crate::session) behind: [u64; RUNGS],
    /// A pass of catching up.
    pub(in crate::session) pass: f64,
    /// The share of re-anchoring.
    pub(in crate::session) anchor: f64,
}

/// The governor of one session.
#[derive(Debug, Clone)]
pub(in crate::session) struct Policy {
    budget: f64,
    ladder: [Sampler; RUNGS],
    len: usize,
    rung: usize,
    /// Milliseconds a unit of work, of the last blocks.
    speeds: [f64; MEMORY],
    seen: u64,
    /// Blocks since the rung changed, and whether it changed upwards.
    calm: u32,
    climbed: bool,
    wait: u32,
    late: u32,
    held: Option<u32>,
    interval: u32,
    /// Late blocks of the fallback in a row, where there is one.
    fallback: Option<u32>,
    stats: GovernorStats,
}

impl Policy {
    /// A ladder from `best` down; `student` tells whether there is a single step.
    pub(in crate::session) fn new(budget: &Budget, best: Sampler, student: bool) -> Self {
        let all = [Sampler::Midpoint4, Sampler::Midpoint2, Sampler::Midpoint1, Sampler::Single];
        let mut ladder = [best; RUNGS];
        let mut len = 1;
        for sampler in all {
            let usable = match sampler {
                Sampler::Single => student,
                Sampler::Midpoint1 => budget.coarse || !student,
                _ => true,
            };
            if usable && sampler.evaluations() < best.evaluations() {
                ladder[len] = sampler;
                len += 1;
            }
        }
        Self {
            budget: f64::from(budget.milliseconds),
            ladder,
            len,
            rung: len - 1,
            speeds: [0.0; MEMORY],
            seen: 0,
            calm: 0,
            climbed: false,
            wait: WAIT[0],
            late: 0,
            held: None,
            interval: REHEARSE[0],
            fallback: None,
            stats: GovernorStats::default(),
        }
    }

    /// One rung alone, of a generator without samplers: it moves or is held.
    pub(in crate::session) fn single(budget: &Budget, sampler: Sampler) -> Self {
        Self { len: 1, rung: 0, ..Self::new(budget, sampler, false) }
    }

    /// The same with counters that go on.
    pub(in crate::session) fn with_stats(mut self, stats: GovernorStats) -> Self {
        self.stats = stats;
        self
    }

    /// The same with something to step down to before motion is held.
    pub(in crate::session) fn with_fallback(mut self, fallback: bool) -> Self {
        self.fallback = fallback.then_some(0);
        self
    }

    /// Samplers, best first.
    pub(in crate::session) fn ladder(&self) -> &[Sampler] {
        &self.ladder[..self.len]
    }

    pub(in crate::session) fn stats(&self) -> GovernorStats {
        self.stats
    }

    /// The time that the block of the last plan took, and its work.
    pub(in crate::session) fn observe(&mut self, plan: &Plan, milliseconds: f64, work: f64) {
        self.stats.missed += u64::from(milliseconds > self.budget);
        if let (Hold::Fallback, Some(late)) = (plan.hold, &mut self.fallback) {
            *late = if milliseconds > self.budget { *late + 1 } else { 0 };
        }
        if matches!(plan.hold, Hold::Yes | Hold::Fallback) || !(milliseconds.is_finite() && milliseconds >= 0.0) {
            return;
        }
        self.speeds[(self.seen % MEMORY as u64) as usize] = milliseconds / work;
        self.seen += 1;
        let last = self.rung == self.len - 1;
        self.late = if last && plan.hold == Hold::No && milliseconds > self.budget { self.late + 1 } else { 0 };
        if plan.hold.rehearses() {
            // What was slow before says nothing about now.
            self.speeds.fill(milliseconds / work);
        }
    }

    /// The slowest recent milliseconds a unit of work.
    fn speed(&self) -> f64 {
        self.speeds[..(self.seen as usize).min(MEMORY)].iter().fold(0.0, |a: f64, b| a.max(*b))
    }

    /// What to do for the next block.
    pub(in crate::session) fn decide(&mut self, outlook: &Outlook) -> Plan {
        let last = self.len - 1;
        if self.seen == 0 {
            return Plan { anchor: false, ..Plan::pinned(self.ladder[last]) };
        }
        if (self.held.is_some() || self.late >= LATE)
            && let Some(plan) = self.hold(outlook.rungs[last][1])
        {
            return plan;
        }
        let speed = self.speed();
        let takes = |work: f64| speed * work;
        let room = HEADROOM * self.budget;
        let mut catch_up = None;

        self.calm = self.calm.saturating_add(1);
        let mut rung = self.rung;
        while rung < last && takes(outlook.rungs[rung][1]) > room {
            rung += 1;
        }
        if self.seen == 1 {
            // Every slot is up to date at the start: straight to the best rung that fits.
            let fits = |r: &usize| takes(outlook.rungs[*r][1]) <= CLIMB * self.budget;
            rung = (0..rung).find(fits).unwrap_or(rung);
        } else if rung == self.rung && rung > 0 && self.calm >= self.wait {
            let [up_to_date, as_it_is] = outlook.rungs[rung - 1];
            if takes(up_to_date) <= CLIMB * self.budget {
                if takes(as_it_is) <= room {
                    rung -= 1;
                } else {
                    let passes = (room / speed - outlook.rungs[rung][1]) / outlook.pass;
                    catch_up = (passes >= 1.0).then(|| ((passes as u8).min(PASSES), self.ladder[rung - 1]));
                }
            }
        }
        self.change(rung);
        // Cheaper rungs are kept ready, so that stepping down costs nothing.
        if catch_up.is_none()
            && let Some(r) = (rung + 1..self.len).find(|r| outlook.behind[*r] >= BEHIND)
        {
            catch_up = Some((1, self.ladder[r]));
        }
        let passes = catch_up.map_or(0.0, |(n, _)| f64::from(n) * outlook.pass);
        let anchor = takes(outlook.rungs[rung][1] + passes + outlook.anchor) <= room;
        self.stats.catch_up_passes += catch_up.map_or(0, |(n, _)| u64::from(n));
        Plan { sampler: self.ladder[rung], catch_up, anchor, hold: Hold::No }
    }

    fn change(&mut self, rung: usize) {
        if rung == self.rung {
            if self.climbed && self.calm == TRIAL {
                self.wait = WAIT[0];
            }
            if self.calm == TRIAL {
                self.interval = REHEARSE[0];
            }
            return;
        }
        if rung > self.rung {
            if self.climbed && self.calm < TRIAL && self.seen > TRIAL.into() {
                self.wait = (2 * self.wait).min(WAIT[1]);
            }
            self.stats.down += 1;
        } else {
            self.stats.up += 1;
        }
        self.climbed = rung < self.rung;
        (self.rung, self.calm) = (rung, 0);
    }

    /// Begins to hold, goes on with it, or (`None`) ends it; `work` is that of the last rung.
    fn hold(&mut self, work: f64) -> Option<Plan> {
        let left = match self.held {
            None => self.interval,
            Some(0) if self.speed() * work <= RETURN * self.budget => {
                (self.held, self.late, self.calm, self.climbed) = (None, 0, 0, false);
                self.interval = (2 * self.interval).min(REHEARSE[1]);
                return None;
            }
            Some(0) => {
                self.interval = (2 * self.interval).min(REHEARSE[1]);
                // The fallback gets another block to be in time.
                self.fallback = self.fallback.map(|late| late.min(LATE - 1));
                self.interval
            }
            Some(left) => left,
        };
        let falls_back = self.fallback.is_some_and(|late| late < LATE);
        *(if falls_back { &mut self.stats.fallback_blocks } else { &mut self.stats.held_blocks }) += 1;
        self.held = Some(left - 1);
        let hold = match (falls_back, left) {
            (false, 1) => Hold::Rehearse,
            (false, _) => Hold::Yes,
            (true, 1) => Hold::RehearseFallback,
            (true, _) => Hold::Fallback,
        };
        Some(Plan { sampler: self.ladder[self.len - 1], catch_up: None, anchor: false, hold })
    }
}
