//! The deadline governor: trades quality for time before a block would come too late.
//!
//! Quality is a ladder of samplers: 8 evaluations per block, 4, and the single-step student
//! (without a student the ladder ends at `midpoint1`, 2 evaluations; with one, `midpoint1` is a
//! rung only if asked for, since undistilled two evaluations make worse motion than the student's
//! one). For every block the governor decides, from the times of the blocks before it,
//!
//! - which rung to use: one whose expected time is at most half the budget, so that a core that
//!   suddenly runs at half speed, or a stall of half a budget, still misses nothing;
//! - how many passes to spend on slots that cheaper rungs left behind, so that they are up to date
//!   before a climb and no block pays for all of it;
//! - whether there is time for a share of re-anchoring;
//! - when blocks of the last rung came late three times in a row: to stop computing. The last
//!   motion eases into a held, breathing pose; now and then one step is rehearsed, and motion comes
//!   back in a cross-fade when that is fast enough. A session with a fallback has that make the
//!   motion meanwhile, and holds only while the fallback comes late as well.
//!
//! Expected time is work ([`costs`], multiply-adds from the config's sizes) times the slowest
//! recent milliseconds per unit of work, which relax by 3 % a block. Sessions start on the last
//! rung and climb with the second block. A climb that had to be taken back makes the next one wait
//! twice as long, up to a minute.
//!
//! Decisions depend on measured times and on nothing else that a replay would not have, so they are
//! recorded, and a session with [`Governor::Replay`] makes the same motion bit for bit.
//!
//! | file | what |
//! |---|---|
//! | `policy` | times in, decisions out; pure |
//! | `costs` | what a block costs on each rung |
//! | `log` | the decisions of a session |

mod costs;
mod log;
mod policy;

pub(super) use costs::{Share, Work};
pub(super) use log::Log;
pub(super) use policy::{Outlook, Policy};

use crate::error::{Error, ErrorKind, Result};
use crate::frame::{BLOCK_FRAMES, FPS, Sampler};
use std::sync::Arc;

/// Who chooses the sampler of each block.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Governor {
    /// The caller: [`super::SessionOptions::sampler`] and [`super::Session::set_sampler`] alone.
    /// The sampler is pinned.
    #[default]
    Off,
    /// The governor, from measured block times. The session's sampler is the best that it uses.
    Budget(Budget),
    /// The decisions of an earlier session, in ascending order of blocks; a decision holds until
    /// the next one. Before the first one, and where a decision's sampler is not supported, the
    /// session's sampler is used.
    Replay(Arc<[Decision]>),
}

impl Governor {
    /// A governor with a budget of `milliseconds` a block, or none for 0: what languages without
    /// this type pass.
    pub fn within(milliseconds: f32) -> Self {
        if milliseconds == 0.0 {
            return Self::Off;
        }
        Self::Budget(Budget { milliseconds, ..Budget::default() })
    }
}

/// What a governed session may spend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// Time that a block may take, milliseconds, 1 to 133.3 (a block's own length): later is a
    /// missed deadline.
    pub milliseconds: f32,
    /// Whether `midpoint1` is a rung above the single step.
    pub coarse: bool,
}

impl Default for Budget {
    /// Three quarters of a block: the rest is for everything else that the caller's thread does.
    fn default() -> Self {
        Self { milliseconds: 100.0, coarse: false }
    }
}

/// What is done for a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// The sampler; while motion is held, the one that is rehearsed and comes back first.
    pub sampler: Sampler,
    /// Passes for slots that are behind, and the sampler that they belong to.
    pub catch_up: Option<(u8, Sampler)>,
    /// Whether a share of re-anchoring may be done.
    pub anchor: bool,
    /// Whether motion is held instead of being computed.
    pub hold: Hold,
}

/// Whether a block is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// It is.
    No,
    /// The last pose is held.
    Yes,
    /// Likewise, and a step is rehearsed to see how long it takes.
    Rehearse,
    /// The session's fallback makes the motion ([`super::Session::set_fallback`]); held where it
    /// has none.
    Fallback,
    /// Likewise, and a step is rehearsed.
    RehearseFallback,
}

impl Hold {
    pub(super) fn rehearses(self) -> bool {
        matches!(self, Self::Rehearse | Self::RehearseFallback)
    }

    pub(super) fn falls_back(self) -> bool {
        matches!(self, Self::Fallback | Self::RehearseFallback)
    }
}

/// From this block on, until the next decision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decision {
    /// Number of the block.
    pub block: u64,
    /// What is done.
    pub plan: Plan,
}

/// What the governor did since the session started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GovernorStats {
    /// Blocks that took longer than the budget.
    pub missed: u64,
    /// Changes to a cheaper sampler.
    pub down: u64,
    /// Changes to a better sampler.
    pub up: u64,
    /// Blocks whose motion was held because even the last rung took too long.
    pub held_blocks: u64,
    /// Blocks that the fallback made for that reason ([`super::Session::set_fallback`]).
    pub fallback_blocks: u64,
    /// Passes spent on catching up.
    pub catch_up_passes: u64,
    /// Decisions that were dropped from the record to make room ([`super::Session::decisions`]).
    pub forgotten_decisions: u64,
}

impl Plan {
    /// As without a governor.
    pub(super) fn pinned(sampler: Sampler) -> Self {
        Self { sampler, catch_up: None, anchor: true, hold: Hold::No }
    }
}

impl Governor {
    pub(super) fn check(&self) -> Result<()> {
        let argument = |message: String| Err(Error::new(ErrorKind::Argument, message));
        let block = 1000.0 * BLOCK_FRAMES as f32 / FPS as f32;
        match self {
            Self::Budget(b) if !(1.0..=block).contains(&b.milliseconds) => {
                argument(format!("a budget of {} ms a block: 1 to {block:.1}", b.milliseconds))
            }
            Self::Replay(list) if !list.is_sorted_by(|a, b| a.block < b.block) => {
                argument("decisions to replay must be in ascending order of blocks".to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// The decision that holds for `block`.
pub(super) fn replayed(list: &[Decision], block: u64) -> Option<Plan> {
    let after = list.partition_point(|d| d.block <= block);
    Some(list.get(after.checked_sub(1)?)?.plan)
}

#[cfg(test)]
mod tests;
