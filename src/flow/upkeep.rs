//! Passes that keep one slot up to date with the history.

use super::history::History;
use super::network::FlowNet;
use super::pass::{Part, Tools};
use super::slots::{CHUNK, Slot, Slots};
use std::ops::Range;

/// Tokens of a slot that are computed anew.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// None before this counts or is seen.
    pub oldest: u64,
    /// The token to go on with.
    pub from: u64,
}

impl Slots {
    /// Tokens that slot `slot` lacks. One that lags by more than a window starts anew a window
    /// back.
    fn lacks(&mut self, history: &History, slot: usize) -> Range<u64> {
        let end = history.len();
        let oldest = end.saturating_sub(self.window);
        let s = &mut self.slots[slot];
        if s.committed < oldest {
            (s.start, s.committed) = (oldest, oldest);
        }
        s.committed..end
    }

    /// Brings slot `slot` nearer to the finished tokens of `history` by one pass; whether it lacked
    /// any.
    pub(super) fn catch_up(&mut self, tools: &mut Tools<'_>, net: &FlowNet, history: &History, slot: usize) -> bool {
        let lacks = self.lacks(history, slot);
        if lacks.is_empty() {
            return false;
        }
        let commit = lacks.start..lacks.end.min(lacks.start + CHUNK);
        tools.work.run_one(tools.exec, net, Part { slots: self, history, slot, commit, new: None });
        true
    }

    /// The same by as many passes as it takes until a chunk at most is lacking, which an evaluation
    /// commits.
    pub(super) fn approach(&mut self, tools: &mut Tools<'_>, net: &FlowNet, history: &History, slot: usize) {
        while self.lacks(history, slot).start + CHUNK < history.len() {
            self.catch_up(tools, net, history, slot);
        }
    }

    /// The part of an evaluation of slot `slot` for the new token at `z`, over the history that the
    /// slot holds and the chunk at most that it lacks.
    pub(super) fn evaluation<'a>(&'a mut self, history: &'a History, slot: usize, z: &'a [f32]) -> Part<'a> {
        let commit = self.slots[slot].committed..history.len();
        Part { slots: self, history, slot, commit, new: Some(z) }
    }

    /// Computes the keys and values of tokens `from..` (at most `CHUNK` of them, none before
    /// `oldest`) of slot `slot` anew, in place, seeing nothing before `oldest`; returns the token
    /// to go on with, or `None` when the slot is through. The rest of the slot stays as it is, so
    /// it can be used between two of these passes.
    pub(super) fn rewrite(
        &mut self,
        tools: &mut Tools<'_>,
        net: &FlowNet,
        history: &History,
        slot: usize,
        Stretch { oldest, from }: Stretch,
    ) -> Option<u64> {
        let Slot { committed, start, .. } = self.slots[slot];
        let window_start = history.len().saturating_sub(self.window);
        let from = from.max(oldest).max(window_start).max(start);
        let to = committed.min(from + CHUNK);
        if from >= to {
            return None;
        }
        self.slots[slot].start = oldest.max(start);
        tools.work.run_one(tools.exec, net, Part { slots: self, history, slot, commit: from..to, new: None });
        self.slots[slot].committed = committed;
        self.slots[slot].start = start;
        (to < committed).then_some(to)
    }
}
