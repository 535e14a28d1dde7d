//! Whether the helper pays: what it saves, against what waiting for it and for a core beside it
//! costs.
//!
//! Where other work wants the cores, a thread that loses its own in the middle of a piece comes
//! back a slice of the scheduler later, milliseconds in which the other one can do nothing; and a
//! helper that spins may be the very thread that the caller lost its core to. So what the helper
//! saves is credited to it and what is lost is taken off. A helper in debt sits out for a time in
//! proportion to the debt, which bounds what trying it again may cost; that time doubles with each
//! trial that fails.

use std::time::Duration;

/// What the helper may have saved up, ns: about a scheduler's slice, so that a quiet machine's odd
/// stall is forgiven.
const CREDIT: i64 = 4_000_000;
/// Time to be computed alone for each unit of debt.
const ALONE: i64 = 40;
/// How often in a row that doubles.
const DOUBLINGS: u32 = 4;
/// Stretches alone after which the helper is tried again in any case.
const STRETCHES: u32 = 256;

/// What happened between a begin and its end.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stretch {
    /// Its length.
    pub(super) elapsed: Duration,
    /// Time in which the caller had no core.
    pub(super) off: Duration,
    /// Time in which the caller waited for the helper, beyond what sharing out takes.
    pub(super) waited: Duration,
    /// Pieces.
    pub(super) pieces: u64,
    /// Those that the helper did.
    pub(super) helped: u64,
}

/// The helper's account.
#[derive(Debug)]
pub(super) struct Ledger {
    /// Nanoseconds, from 0 to [`CREDIT`].
    credit: i64,
    /// Nanoseconds to be computed alone.
    alone: i64,
    /// Stretches after which that ends in any case.
    stretches: u32,
    doublings: u32,
}

impl Ledger {
    pub(super) fn new() -> Self {
        Self { credit: CREDIT, alone: 0, stretches: 0, doublings: 0 }
    }

    /// Whether the helper takes part in the next stretch.
    pub(super) fn together(&self) -> bool {
        self.alone == 0
    }

    /// Whether the helper should leave a stretch in which the caller has waited for it so long.
    pub(super) fn exceeds(&self, waited: Duration) -> bool {
        nanos(waited) > self.credit
    }

    /// Enters a stretch that was computed as [`Ledger::together`] said.
    pub(super) fn enter(&mut self, stretch: &Stretch) {
        let elapsed = nanos(stretch.elapsed);
        if !self.together() {
            self.stretches -= 1;
            self.alone = if self.stretches == 0 { 0 } else { (self.alone - elapsed).max(0) };
            return;
        }
        let lost = nanos(stretch.off.saturating_add(stretch.waited)).min(elapsed);
        // The threads share memory's bandwidth: alone, the caller would have taken about half as
        // long for the helper's pieces as for as many of its own.
        let own = (stretch.pieces - stretch.helped).max(1);
        let saved = (elapsed - lost) as f64 * stretch.helped as f64 / own as f64 / 2.0;
        self.credit = (self.credit.saturating_add(saved as i64) - lost).min(CREDIT);
        if self.credit < 0 {
            self.alone = (self.credit.max(-CREDIT) * -ALONE) << self.doublings;
            self.stretches = STRETCHES;
            self.doublings = DOUBLINGS.min(self.doublings + 1);
            self.credit = 0;
        } else if self.credit == CREDIT {
            self.doublings = 0;
        }
    }
}

fn nanos(time: Duration) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: f64) -> Duration {
        Duration::from_secs_f64(ms / 1000.0)
    }

    /// A stretch with a helper that did half of the pieces.
    fn stretch(elapsed: f64, off: f64, waited: f64) -> Stretch {
        Stretch { elapsed: ms(elapsed), off: ms(off), waited: ms(waited), pieces: 1000, helped: 500 }
    }

    #[test]
    fn a_helper_that_saves_more_than_it_costs_stays() {
        let mut ledger = Ledger::new();
        for i in 0..1000 {
            // A stall each third block: 4 ms lost, three times about 3 saved.
            ledger.enter(&stretch(if i % 3 == 0 { 10.0 } else { 6.0 }, 0.0, if i % 3 == 0 { 4.0 } else { 0.0 }));
            assert!(ledger.together());
        }
    }

    #[test]
    fn stalls_send_it_away_whoever_has_them() {
        for (off, waited) in [(12.0, 0.0), (0.0, 12.0), (6.0, 6.0)] {
            let mut ledger = Ledger::new();
            ledger.enter(&stretch(18.0, off, waited));
            assert!(!ledger.together());
        }
        // It also leaves in the middle of a stretch, as soon as its credit is used up.
        let ledger = Ledger::new();
        assert!(!ledger.exceeds(ms(3.9)) && ledger.exceeds(ms(4.1)));
    }

    /// Blocks of 10 ms alone; with the helper `lost` ms more.
    fn trials(ledger: &mut Ledger, blocks: usize, lost: f64) -> usize {
        let mut count = 0;
        for _ in 0..blocks {
            count += usize::from(ledger.together());
            let together = Stretch { helped: 0, ..stretch(10.0 + lost, 0.0, lost) };
            ledger.enter(&if ledger.together() { together } else { stretch(10.0, 0.0, 0.0) });
        }
        count
    }

    #[test]
    fn trying_again_costs_a_small_share_of_the_time() {
        for lost in [0.3, 1.0, 4.0, 8.0] {
            let mut ledger = Ledger::new();
            ledger.credit = 0;
            let (blocks, mut spent) = (2000, 0.0);
            for _ in 0..5 {
                spent = trials(&mut ledger, blocks, lost) as f64 * lost;
            }
            assert!(spent <= 0.01 * 10.0 * blocks as f64, "{spent} ms for {lost} ms a trial");
        }
    }

    #[test]
    fn it_comes_back_when_the_other_work_is_gone() {
        let mut ledger = Ledger::new();
        trials(&mut ledger, 5000, 8.0);
        let mut blocks = 0;
        while !ledger.together() {
            ledger.enter(&stretch(1.0, 0.0, 0.0));
            blocks += 1;
        }
        assert!(blocks <= STRETCHES);
        for _ in 0..100 {
            ledger.enter(&stretch(6.0, 0.0, 0.0));
            assert!(ledger.together());
        }
        assert_eq!((ledger.credit, ledger.doublings), (CREDIT, 0));
    }

    #[test]
    fn odd_figures_are_survived() {
        for stretch in [
            Stretch::default(),
            Stretch { elapsed: Duration::MAX, helped: 9, pieces: 9, ..Stretch::default() },
            Stretch { elapsed: Duration::MAX, off: Duration::MAX, waited: Duration::MAX, ..Stretch::default() },
        ] {
            let mut ledger = Ledger::new();
            for _ in 0..3 {
                ledger.enter(&stretch);
            }
            assert!((0..=CREDIT).contains(&ledger.credit) && ledger.alone >= 0);
        }
    }
}
