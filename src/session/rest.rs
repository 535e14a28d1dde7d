//! Whether the body is at rest, and how active it is then.
//!
//! People at rest are not equally active all the time: they stand like a post for ten seconds, and
//! then look for something to do with their hands. A network that is not told which it is to be
//! plays the mean of both and stays in it. It is told what one stretch of a real person was like,
//! another one every now and then, while the agent is silent and the user stands; not while there
//! is something to react to. Mirrors `training/visavis_train/train/activity.py`.

use super::gaze::drawn;
use crate::config::{ACTIVITY, RestConfig};
use crate::frame::{BLOCK_FRAMES, Sampler};
use glam::{Vec2, Vec3};

/// Peak of a voice that speaks.
pub(super) const LOUD: f32 = 0.03;
/// Frames since the agent spoke last from which on it is at rest.
const QUIET: u64 = 32;
/// A user who stands moves by less in [`MEMORY`] blocks, metres.
const STANDS: f32 = 0.25;
/// Blocks over which a user's way counts, 1.07 s.
const MEMORY: usize = 8;
/// More of a call for a reaction ends the rest.
const CALLED: f32 = 0.25;
/// Free gaze and activity are drawn apart.
const OTHER: u64 = 0x5245_5354;

/// What tells rest.
#[derive(Debug)]
pub(super) struct Rest {
    /// Where the user was seen in the last blocks, the latest in `next - 1`.
    seen: [Option<Vec2>; MEMORY],
    next: usize,
}

impl Rest {
    pub(super) fn new() -> Self {
        Self { seen: [None; MEMORY], next: 0 }
    }

    pub(super) fn reset(&mut self) {
        *self = Self::new();
    }

    /// Whether the body is at rest in block `block`: `spoke` is the last frame in which the agent
    /// spoke, `user` where the user's head was last seen, `called` how much of what is heard calls
    /// for a reaction. Once a block.
    pub(super) fn look(&mut self, block: u64, spoke: Option<u64>, user: Option<Vec3>, called: f32) -> bool {
        let user = user.map(|head| Vec2::new(head.x, head.z));
        let before = std::mem::replace(&mut self.seen[self.next], user);
        self.next = (self.next + 1) % MEMORY;
        let last = (block + 1) * BLOCK_FRAMES as u64 - 1;
        let quiet = spoke.is_none_or(|frame| frame + QUIET <= last);
        let stands = before.zip(user).is_none_or(|(a, b)| a.distance(b) < STANDS);
        quiet && stands && called < CALLED
    }
}

/// What the network of `sampler` is told in block `block` of a session with this seed, if the body
/// is at rest then: what makes it as active as a real person in one stretch.
pub(super) fn level(config: &RestConfig, sampler: Sampler, seed: u64, block: u64) -> Option<[f32; ACTIVITY]> {
    let at = drawn(seed ^ OTHER, block, config.seconds) * config.levels.len() as f32;
    let wanted = config.levels.get((at as usize).min(config.levels.len().saturating_sub(1)))?;
    let curves = if sampler == Sampler::Single { &config.student } else { &config.reference };
    Some(curves.as_ref().map_or(*wanted, |curves| std::array::from_fn(|i| curves[i].channel(wanted[i]))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::ResponseCurve;

    #[test]
    fn rest_is_silence_before_a_user_who_stands() {
        let mut rest = Rest::new();
        let at = |x: f32| Some(Vec3::new(x, 1.6, 1.5));
        assert!(rest.look(0, None, None, 0.0), "a session begins at rest");
        assert!(!rest.look(1, Some(5), at(0.0), 0.0), "the agent speaks");
        assert!(!rest.look(8, Some(5), at(0.0), 0.0) && rest.look(9, Some(5), at(0.0), 0.0), "a second later");
        assert!(!rest.look(10, None, at(0.0), 0.9), "something happened");
        // A step to the side ends it for as long as it is remembered.
        let stands = (11..11 + MEMORY as u64).all(|block| rest.look(block, None, at(0.0), 0.0));
        let stepped: Vec<bool> = (0..2 * MEMORY as u64).map(|i| rest.look(19 + i, None, at(0.6), 0.0)).collect();
        let (remembered, forgotten) = stepped.split_at(MEMORY);
        assert!(stands && remembered.iter().all(|rests| !rests) && forgotten.iter().all(|rests| *rests), "{stepped:?}");
    }

    #[test]
    fn stretches_are_drawn_alike_from_all_levels() {
        let levels: Vec<[f32; ACTIVITY]> = (0..4).map(|i| [i as f32, 0.0, 0.0]).collect();
        let shifted = || ResponseCurve(vec![[0.0, 0.5], [3.0, 3.5]]);
        let student = Some(std::array::from_fn(|_| shifted()));
        let config = RestConfig { embed: 1, levels, seconds: 10.0, reference: None, student };
        let mut seen = [0; 4];
        let mut changes = 0;
        for block in 0..100_000 {
            let now = level(&config, Sampler::Midpoint4, 5, block).unwrap()[0] as usize;
            seen[now] += 1;
            changes += usize::from(now != level(&config, Sampler::Midpoint4, 5, block + 1).unwrap()[0] as usize);
        }
        assert!(seen.iter().all(|n| (20_000..30_000).contains(n)), "{seen:?}");
        // Three of four borders lead to another level.
        assert!((900..1100).contains(&changes), "{changes} in 13 333 s");
        let wanted = level(&config, Sampler::Midpoint4, 5, 3).unwrap();
        assert_eq!(level(&config, Sampler::Single, 5, 3), Some([wanted[0] + 0.5, 0.5, 0.5]));
        assert_eq!(level(&RestConfig { levels: vec![], ..config }, Sampler::Midpoint4, 5, 3), None);
    }
}
