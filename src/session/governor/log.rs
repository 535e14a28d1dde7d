//! The record of a session's decisions.

use super::{Decision, Plan};

/// Changes that are kept: hours of motion on a device whose speed is steady, minutes on one where
/// every block is another.
const CAPACITY: usize = 8192;

/// The last decisions, each where it differs from the one before. Allocates when made and never
/// after.
#[derive(Debug)]
pub(in crate::session) struct Log {
    ring: Vec<Decision>,
    next: usize,
    forgotten: u64,
}

impl Log {
    pub(in crate::session) fn new() -> Self {
        Self { ring: Vec::with_capacity(CAPACITY), next: 0, forgotten: 0 }
    }

    pub(in crate::session) fn clear(&mut self) {
        self.ring.clear();
        (self.next, self.forgotten) = (0, 0);
    }

    /// Records the plan of `block` if it is another than the one before.
    pub(in crate::session) fn record(&mut self, block: u64, plan: Plan) {
        let last = (self.next + self.ring.len().max(1) - 1) % self.ring.len().max(1);
        if self.ring.get(last).is_some_and(|d| d.plan == plan) {
            return;
        }
        let decision = Decision { block, plan };
        if self.ring.len() < CAPACITY {
            self.ring.push(decision);
        } else {
            self.ring[self.next] = decision;
            self.next = (self.next + 1) % CAPACITY;
            self.forgotten += 1;
        }
    }

    /// Oldest first.
    pub(in crate::session) fn iter(&self) -> impl Iterator<Item = Decision> + '_ {
        let (newer, older) = self.ring.split_at(self.next.min(self.ring.len()));
        older.iter().chain(newer).copied()
    }

    pub(in crate::session) fn forgotten(&self) -> u64 {
        self.forgotten
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Sampler;

    #[test]
    fn keeps_changes_and_the_last_of_them() {
        let mut log = Log::new();
        let plan = |n: u64| Plan { anchor: n.is_multiple_of(2), ..Plan::pinned(Sampler::Single) };
        (0..10).for_each(|block| log.record(block, plan(block / 5)));
        let blocks: Vec<_> = log.iter().map(|d| d.block).collect();
        assert_eq!(blocks, [0, 5]);
        (10..10 + CAPACITY as u64).for_each(|block| log.record(block, plan(block)));
        let kept: Vec<_> = log.iter().collect();
        assert_eq!((kept.len(), log.forgotten()), (CAPACITY, 2));
        assert!(kept.windows(2).all(|w| w[0].block < w[1].block && w[0].plan != w[1].plan));
        assert_eq!(kept.last().map(|d| d.block), Some(9 + CAPACITY as u64));
    }
}
