//! The policy against simulated devices. Times come from prices that are not the governor's own.

use super::policy::{Outlook, Policy};
use super::{Budget, Governor, Hold, Plan, replayed};
use crate::frame::Sampler;
use proptest::prelude::*;

const BUDGET: f64 = 100.0;

/// A device and the slots of a session on it, in a few lines: how many tokens each rung's slots
/// lack.
struct Device {
    policy: Policy,
    /// Tokens that the slots of each rung of the ladder lack.
    behind: [u64; 5],
    times: Vec<f64>,
    plans: Vec<Plan>,
}

/// Milliseconds of a rung at full speed, and of a pass and of re-anchoring: as measured on one
/// computer, scaled up.
fn time(sampler: Sampler) -> f64 {
    match sampler {
        Sampler::Midpoint4 => 43.0,
        Sampler::Midpoint2 => 29.0,
        Sampler::Midpoint1 => 22.0,
        _ => 13.0,
    }
}
const PASS: f64 = 7.0;
const ANCHOR: f64 = 15.0;

/// Units of work as the governor sees them.
fn work(sampler: Sampler) -> f64 {
    match sampler {
        Sampler::Midpoint4 => 121.0,
        Sampler::Midpoint2 => 71.0,
        Sampler::Midpoint1 => 46.0,
        _ => 27.0,
    }
}
const PASS_WORK: f64 = 25.0;
const ANCHOR_WORK: f64 = 53.0;

impl Device {
    fn new(budget: Budget, best: Sampler, student: bool) -> Self {
        Self { policy: Policy::new(&budget, best, student), behind: [1; 5], times: Vec::new(), plans: Vec::new() }
    }

    fn typical() -> Self {
        Self::new(Budget { milliseconds: BUDGET as f32, coarse: false }, Sampler::Midpoint4, true)
    }

    /// One block on a device that is `slow` times slower than at full speed, with `stall`
    /// milliseconds of something else.
    fn block(&mut self, slow: f64, stall: f64) -> Plan {
        let ladder: Vec<_> = self.policy.ladder().to_vec();
        let mut outlook = Outlook { pass: PASS_WORK, anchor: ANCHOR_WORK, behind: self.behind, ..Outlook::default() };
        let backlog = |r: usize, behind: &[u64; 5]| behind[r].saturating_sub(1).div_ceil(8) as f64;
        for (r, sampler) in ladder.iter().enumerate() {
            let up_to_date = work(*sampler);
            outlook.rungs[r] = [up_to_date, up_to_date + PASS_WORK * backlog(r, &self.behind)];
        }
        let plan = self.policy.decide(&outlook);
        let rung = ladder.iter().position(|s| *s == plan.sampler).expect("a rung of the ladder");
        let (mut ms, mut units) = match plan.hold {
            Hold::No => (time(plan.sampler), work(plan.sampler)),
            Hold::Rehearse | Hold::RehearseFallback => (5.0, 9.5),
            Hold::Yes | Hold::Fallback => (0.1, 0.0),
        };
        if plan.hold == Hold::No {
            let extra = backlog(rung, &self.behind);
            (ms, units) = (ms + PASS * extra, units + PASS_WORK * extra);
            for (r, behind) in self.behind.iter_mut().enumerate() {
                // The midpoint rules below a midpoint rule use some of its slots.
                let shares = r == rung || (r > rung && ladder.get(r).is_some_and(|s| *s != Sampler::Single));
                *behind = if shares { 1 } else { (*behind + 1).min(48) };
            }
            if let Some((passes, sampler)) = plan.catch_up {
                let r = ladder.iter().position(|s| *s == sampler).expect("a rung of the ladder");
                self.behind[r] = self.behind[r].saturating_sub(8 * u64::from(passes)).max(1);
                (ms, units) = (ms + PASS * f64::from(passes), units + PASS_WORK * f64::from(passes));
            }
            if plan.anchor {
                (ms, units) = (ms + ANCHOR, units + ANCHOR_WORK);
            }
        }
        let took = slow * ms + stall;
        self.policy.observe(&plan, took, units);
        self.times.push(took);
        self.plans.push(plan);
        plan
    }

    fn missed(&self) -> usize {
        self.times.iter().filter(|t| **t > BUDGET).count()
    }
}

#[test]
fn ladders() {
    let ladder =
        |best, student, coarse| Policy::new(&Budget { milliseconds: 100.0, coarse }, best, student).ladder().to_vec();
    use Sampler::{Midpoint1, Midpoint2, Midpoint4, Single};
    assert_eq!(ladder(Midpoint4, true, false), [Midpoint4, Midpoint2, Single]);
    assert_eq!(ladder(Midpoint4, true, true), [Midpoint4, Midpoint2, Midpoint1, Single]);
    assert_eq!(ladder(Midpoint4, false, false), [Midpoint4, Midpoint2, Midpoint1]);
    assert_eq!(ladder(Midpoint2, true, false), [Midpoint2, Single]);
    assert_eq!(ladder(Sampler::euler(64).unwrap(), true, true).len(), 5);
    assert_eq!(ladder(Single, true, false), [Single]);
}

#[test]
fn a_fast_device_climbs_at_once_and_stays() {
    let mut device = Device::typical();
    assert_eq!(device.block(0.3, 0.0).sampler, Sampler::Single);
    (0..500).for_each(|_| assert_eq!(device.block(0.3, 0.0).sampler, Sampler::Midpoint4));
    assert_eq!((device.missed(), device.policy.stats().down), (0, 0));
    assert!(device.plans[10..].iter().all(|p| p.anchor), "there is time for re-anchoring");
}

/// A core that runs at half speed from some block on, for ever: nothing is missed, and the rung
/// that fits is kept.
#[test]
fn a_permanent_half_speed_core_misses_nothing() {
    for start in [0, 1, 40, 333] {
        let mut device = Device::typical();
        for block in 0..1500 {
            device.block(if block < start { 1.0 } else { 2.0 }, 0.0);
        }
        assert_eq!(device.missed(), 0, "half speed from block {start} on");
        let late = &device.plans[1000..];
        assert!(late.iter().all(|p| p.hold == Hold::No && *p == late[0]), "no hunting between rungs");
    }
}

/// Heat that comes within a minute, stays and goes, slowing the core four times: the single step
/// takes 52 ms then.
#[test]
fn heat_that_comes_and_goes_misses_nothing_and_is_climbed_out_of() {
    let mut device = Device::typical();
    let slow = |block: usize| {
        let ramp = |from: usize| ((block.saturating_sub(from)) as f64 / 450.0).min(1.0);
        0.8 + 3.2 * (ramp(200) - ramp(1500))
    };
    for block in 0..3500 {
        device.block(slow(block), 0.0);
    }
    assert_eq!(device.missed(), 0);
    assert!(device.plans[800..1400].iter().all(|p| p.sampler == Sampler::Single), "the heat is on");
    assert_eq!(device.plans.last().map(|p| p.sampler), Some(Sampler::Midpoint4), "and over");
    let stats = device.policy.stats();
    assert!(stats.down <= 6 && stats.up <= 6, "{stats:?}: no hunting");
    assert!(stats.catch_up_passes >= 8, "slots caught up before the climb");
}

/// Something else takes 45 ms of a block now and then; the single step fits beside it, and no
/// deadline is missed.
#[test]
fn single_stalls_cost_quality_for_seconds_and_no_deadline() {
    let mut device = Device::typical();
    for block in 0..3000 {
        device.block(0.8, if block % 400 == 399 { 45.0 } else { 0.0 });
    }
    assert_eq!(device.missed(), 0);
    let best = device.plans.iter().filter(|p| p.sampler == Sampler::Midpoint4).count();
    let single = device.plans.iter().filter(|p| p.sampler == Sampler::Single).count();
    assert!(best > 2000 && single < 600, "{best} blocks on the best rung, {single} on the last");
    assert_eq!(device.policy.stats().held_blocks, 0);
}

/// One stall of a second: that block is late, whatever anyone decides; motion is not held for it.
#[test]
fn one_long_stall_is_one_missed_deadline() {
    let mut device = Device::typical();
    for block in 0..400 {
        device.block(0.8, if block == 200 { 1000.0 } else { 0.0 });
    }
    assert_eq!((device.missed(), device.policy.stats().held_blocks), (1, 0));
}

/// Too slow for the single step for a while: held, rehearsed, and back.
#[test]
fn what_cannot_keep_up_is_held_and_comes_back() {
    let mut device = Device::typical();
    let slow = |block: usize| if (100..900).contains(&block) { 12.0 } else { 0.8 };
    for block in 0..1600 {
        device.block(slow(block), 0.0);
    }
    let held = device.plans.iter().filter(|p| p.hold != Hold::No).count();
    assert!(held > 700, "{held} blocks held");
    assert!(device.plans[900 + 65..].iter().all(|p| p.hold == Hold::No), "back within 8.5 s");
    assert_eq!(device.plans.last().map(|p| p.sampler), Some(Sampler::Midpoint4));
    assert!(device.missed() <= 8, "{} late blocks: the slow ones before it was held", device.missed());
    assert_eq!(device.policy.stats().missed as usize, device.missed());
}

#[test]
fn cheaper_rungs_are_kept_ready() {
    let mut device = Device::typical();
    for _ in 0..200 {
        device.block(0.5, 0.0);
        let last = device.policy.ladder().len() - 1;
        assert!(device.behind[last] <= 8, "the student's slot lacks {}", device.behind[last]);
    }
}

proptest! {
    /// Whatever a device does, as long as no block is more than twice as slow as the slowest of the
    /// ten before it, no deadline is missed where the single step, with headroom for such a change,
    /// fits.
    #[test]
    fn nothing_is_missed_where_the_single_step_fits(
        steps in prop::collection::vec((0.3f64..1.4, 1usize..60), 1..40),
    ) {
        let mut device = Device::typical();
        let mut slow = 1.0;
        for (factor, blocks) in steps {
            // The governor's prices and the device's differ by a factor of 1.4 between rungs.
            slow = (slow * factor).clamp(0.2, 3.5);
            for _ in 0..blocks {
                device.block(slow, 0.0);
            }
        }
        prop_assert_eq!(device.missed(), 0);
    }

    /// Any times whatsoever, NaN and negative ones included, give plans of the ladder.
    #[test]
    fn any_times_are_survived(times in prop::collection::vec(any::<f64>(), 1..200)) {
        let mut policy = Policy::new(&Budget::default(), Sampler::Midpoint4, true);
        for ms in times {
            let outlook = Outlook { rungs: [[10.0, 12.0]; 5], behind: [3; 5], pass: 2.0, anchor: 4.0 };
            let plan = policy.decide(&outlook);
            prop_assert!(policy.ladder().contains(&plan.sampler));
            policy.observe(&plan, ms, 10.0);
        }
    }
}

#[test]
fn replays_hold_until_the_next_decision() {
    let plan = Plan::pinned(Sampler::Single);
    let decision = |block| super::Decision { block, plan };
    assert_eq!(replayed(&[decision(3)], 2), None);
    assert_eq!(replayed(&[decision(3)], 3), Some(plan));
    assert_eq!(replayed(&[decision(3), decision(9)], u64::MAX), Some(plan));
    assert!(Governor::Replay([decision(3), decision(3)].into()).check().is_err());
    assert!(Governor::Budget(Budget { milliseconds: 0.5, coarse: false }).check().is_err());
    assert!(Governor::Budget(Budget { milliseconds: f32::NAN, coarse: false }).check().is_err());
    assert!(Governor::Budget(Budget::default()).check().is_ok());
}
