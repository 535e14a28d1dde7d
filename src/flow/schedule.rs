//! Flow times as fractions, and the slots of the reference network by number.

use crate::config::CleanHistory;
use crate::frame::Sampler;

/// The grid of the midpoint rules and of Euler with 1, 2, 4 or 8 steps: every session has slots for
/// it.
const GRID: u8 = 8;

/// Guidance branches that a network is run with at a flow time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branches {
    /// Unconditional, conditional without the gaze target, and conditional with it.
    Guided,
    /// Conditional alone, gaze target included when set: guidance is distilled into the weights, or
    /// has done its part at earlier flow times.
    Plain,
}

/// What a slot is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlotTimes {
    /// Flow time at which its history is seen.
    pub history: f32,
    /// That of the new token.
    pub new: f32,
    /// Branches that are run.
    pub branches: Branches,
}

/// A flow time, a fraction in lowest terms: equal times are equal fractions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FlowTime {
    numerator: u8,
    denominator: u8,
}

impl FlowTime {
    /// `numerator / denominator`; the denominator is not 0.
    fn new(numerator: u8, denominator: u8) -> Self {
        let (mut a, mut b) = (denominator, numerator);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        Self { numerator: numerator / a, denominator: denominator / a }
    }

    /// That of evaluation `i` of `sampler`: the midpoint rule looks at its steps' starts and
    /// middles, Euler's at their starts.
    pub(super) fn of(sampler: Sampler, i: usize) -> Self {
        // At most 64 evaluations.
        Self::new(i as u8, sampler.evaluations() as u8)
    }

    /// The nearest f32.
    pub(super) fn value(self) -> f32 {
        f32::from(self.numerator) / f32::from(self.denominator)
    }
}

/// The flow times of the reference network's slots, in the order of their numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Schedule(Vec<FlowTime>);

impl Schedule {
    /// The eighths, and what `sampler` visits besides.
    pub(super) fn new(sampler: Sampler) -> Self {
        let mut this = Self((0..GRID).map(|i| FlowTime::new(i, GRID)).collect());
        let visited = (0..sampler.evaluations()).map(|i| FlowTime::of(sampler, i));
        let more: Vec<_> = visited.filter(|time| this.number(*time).is_none()).collect();
        this.0.extend(more);
        this
    }

    /// The slot of a flow time, if there is one.
    fn number(&self, time: FlowTime) -> Option<usize> {
        self.0.iter().position(|t| *t == time)
    }

    /// Whether there is a slot for each evaluation of `sampler`, which is not the single step.
    pub(super) fn covers(&self, sampler: Sampler) -> bool {
        self.visits(sampler).count() == sampler.evaluations()
    }

    /// Slots of the evaluations of `sampler`, in order, as far as they are there.
    pub(super) fn visits(&self, sampler: Sampler) -> impl Iterator<Item = usize> + '_ {
        (0..sampler.evaluations()).filter_map(move |i| self.number(FlowTime::of(sampler, i)))
    }

    /// What each slot is made for.
    fn times(&self, clean_history: Option<CleanHistory>, guided_until: Option<f32>) -> Vec<SlotTimes> {
        let times = |new: f32| SlotTimes {
            history: clean_history.map_or(new, |c| c.time(new)),
            new,
            branches: if guided_until.is_none_or(|end| new < end) { Branches::Guided } else { Branches::Plain },
        };
        self.0.iter().map(|time| times(time.value())).collect()
    }
}

/// The reference network's slots for `sampler` and the midpoint rules.
pub fn reference_slots(
    sampler: Sampler,
    clean_history: Option<CleanHistory>,
    guided_until: Option<f32>,
) -> Vec<SlotTimes> {
    Schedule::new(sampler).times(clean_history, guided_until)
}

/// The student's one slot, which sees its history at `tau_history`.
pub fn student_slots(tau_history: f32) -> Vec<SlotTimes> {
    vec![SlotTimes { history: tau_history, new: 0.0, branches: Branches::Plain }]
}

/// Flow times of slots, in turns those of the history and of the new token.
pub fn flow_times(slots: &[SlotTimes]) -> Vec<f32> {
    slots.iter().flat_map(|slot| [slot.history, slot.new]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> impl Iterator<Item = Sampler> {
        let midpoint = [Sampler::Midpoint4, Sampler::Midpoint2, Sampler::Midpoint1];
        midpoint.into_iter().chain((1..=64).map(|n| Sampler::euler(n).unwrap()))
    }

    #[test]
    fn a_slot_for_each_evaluation_and_none_twice() {
        for made_for in all() {
            let schedule = Schedule::new(made_for);
            let times = schedule.times(None, Some(0.3));
            assert!(times.iter().all(|slot| slot.history == slot.new && (0.0..1.0).contains(&slot.new)));
            assert!(times.iter().all(|slot| (slot.branches == Branches::Guided) == (slot.new < 0.3)));
            for (i, a) in schedule.0.iter().enumerate() {
                assert!(schedule.0[..i].iter().all(|b| a != b && a.value() != b.value()), "{made_for}: {a:?}");
            }
            for sampler in all() {
                let own = sampler == made_for || 8 % sampler.evaluations() == 0;
                assert!(!own || schedule.covers(sampler), "{sampler} in a session made for {made_for}");
                for (i, slot) in schedule.visits(sampler).enumerate() {
                    let at = i as f32 / sampler.evaluations() as f32;
                    assert!(!schedule.covers(sampler) || schedule.0[slot].value() == at, "{sampler}, evaluation {i}");
                }
            }
        }
        assert!(!Schedule::new(Sampler::Midpoint4).covers(Sampler::euler(3).unwrap()));
        assert!(Schedule::new(Sampler::euler(6).unwrap()).covers(Sampler::euler(3).unwrap()), "thirds are sixths");
    }
}
