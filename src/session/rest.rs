//! Whether the body is at rest, and how active it is then.
//!
//! People at rest are not equally active all the time: they stand like a post for ten seconds, and
//! then look for something to do with their hands. A network that is not told which it is to be
//! plays the mean of both and stays in it. It is told what one stretch of a real person was like,
//! another one every now and then, while the agent is silent and the user stands; not while there
//! is something to react to. Mirrors `training/visavis_train/train/activity.py`.

use super::gaze::drawn;
use crate::config::{ACTIVITY, Company, RestConfig};
use crate::frame::{BLOCK_FRAMES, Sampler};
use glam::{Vec2, Vec3};

/// Peak of a voice that speaks.
pub(super) const LOUD: f32 = 0.03;
/// Frames since a voice was last loud from which on it is silent.
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

    /// In whose company the body is at rest in block `block`, if it is: `spoke` are the last frames
    /// in which the agent and the user spoke, `user` where the user's head was last seen, `called`
    /// how much of what is heard calls for a reaction. Once a block.
    pub(super) fn look(
        &mut self,
        block: u64,
        spoke: [Option<u64>; 2],
        user: Option<Vec3>,
        called: f32,
    ) -> Option<Company> {
        let user = user.map(|head| Vec2::new(head.x, head.z));
        let before = std::mem::replace(&mut self.seen[self.next], user);
        self.next = (self.next + 1) % MEMORY;
        let last = (block + 1) * BLOCK_FRAMES as u64 - 1;
        let [agent, speaking] = spoke.map(|frame| frame.is_some_and(|frame| frame + QUIET > last));
        let stands = before.zip(user).is_none_or(|(a, b)| a.distance(b) < STANDS);
        let company = match user {
            _ if speaking => Company::Speaking,
            Some(_) => Company::Silent,
            None => Company::Nobody,
        };
        (!agent && stands && called < CALLED).then_some(company)
    }
}

/// What the network of `sampler` is told in block `block` of a session with this seed, if the body
/// is at rest then in this company: what makes it as active as a real person in one stretch.
pub(super) fn level(
    config: &RestConfig,
    sampler: Sampler,
    seed: u64,
    block: u64,
    company: Company,
) -> Option<[f32; ACTIVITY]> {
    let response = if sampler == Sampler::Single { &config.student } else { &config.reference }.as_ref();
    let seconds = response.map_or(config.seconds, |response| response.seconds);
    let at = drawn(seed ^ OTHER, block, seconds) * config.levels.len() as f32;
    let wanted = *config.levels.get((at as usize).min(config.levels.len().saturating_sub(1)))?;
    Some(response.map_or(wanted, |response| response.told(wanted, company)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{ResponseCurve, RestResponse};

    #[test]
    fn rest_is_silence_before_a_user_who_stands() {
        let mut rest = Rest::new();
        let at = |x: f32| Some(Vec3::new(x, 1.6, 1.5));
        let (silence, silent) = ([None; 2], Some(Company::Silent));
        assert_eq!(rest.look(0, silence, None, 0.0), Some(Company::Nobody), "a session begins at rest");
        let agent = [Some(5), None];
        assert_eq!(rest.look(1, agent, at(0.0), 0.0), None, "the agent speaks");
        assert_eq!(rest.look(8, agent, at(0.0), 0.0), None);
        assert_eq!(rest.look(9, agent, at(0.0), 0.0), silent, "a second later");
        assert_eq!(rest.look(10, silence, at(0.0), 0.9), None, "something happened");
        let user = [None, Some(43)];
        assert_eq!(rest.look(11, user, at(0.0), 0.0), Some(Company::Speaking), "the user speaks");
        assert_eq!(rest.look(12, user, None, 0.0), Some(Company::Speaking), "on the telephone");
        assert_eq!(rest.look(19, user, at(0.0), 0.0), silent);
        // A step to the side ends it for as long as it is remembered.
        let stands = (20..20 + MEMORY as u64).all(|block| rest.look(block, silence, at(0.0), 0.0) == silent);
        let stepped: Vec<_> = (0..2 * MEMORY as u64).map(|i| rest.look(28 + i, silence, at(0.6), 0.0)).collect();
        let (remembered, forgotten) = stepped.split_at(MEMORY);
        assert!(stands && remembered.iter().all(Option::is_none), "{stepped:?}");
        assert!(forgotten.iter().all(|company| *company == silent), "{stepped:?}");
    }

    #[test]
    fn stretches_are_drawn_alike_from_all_levels() {
        let levels: Vec<[f32; ACTIVITY]> = (0..4).map(|i| [i as f32, 0.0, 0.0]).collect();
        let curves = std::array::from_fn(|_| ResponseCurve(vec![[0.0, 0.5], [3.0, 3.5]]));
        let (alone, listening) = ([0.0, 0.25, 0.0], [0.0, 0.0, 1.0]);
        let student = Some(RestResponse { curves, alone, listening, seconds: 20.0 });
        let config = RestConfig { embed: 1, levels, seconds: 10.0, reference: None, student };
        let mut seen = [0; 4];
        let mut changes = 0;
        for block in 0..100_000 {
            let at = |block| level(&config, Sampler::Midpoint4, 5, block, Company::Silent).unwrap()[0] as usize;
            seen[at(block)] += 1;
            changes += usize::from(at(block) != at(block + 1));
        }
        assert!(seen.iter().all(|n| (20_000..30_000).contains(n)), "{seen:?}");
        // Three of four borders lead to another level.
        assert!((900..1100).contains(&changes), "{changes} in 13 333 s");
        let single = |block| level(&config, Sampler::Single, 5, block, Company::Silent).unwrap()[0] as usize;
        let changes = (0..100_000).filter(|block| single(*block) != single(block + 1)).count();
        assert!((450..550).contains(&changes), "{changes} in 13 333 s of the student");
        let [stirring, ..] = level(&config, Sampler::Midpoint4, 5, 3, Company::Nobody).unwrap();
        let told = |company| level(&config, Sampler::Single, 5, 3, company).unwrap();
        assert_eq!(told(Company::Silent), [stirring + 0.5, 0.5, 0.5]);
        assert_eq!(told(Company::Nobody), [stirring + 0.5, 0.75, 0.5]);
        assert_eq!(told(Company::Speaking), [stirring + 0.5, 0.5, 1.5]);
        let none = RestConfig { levels: vec![], ..config };
        assert_eq!(level(&none, Sampler::Midpoint4, 5, 3, Company::Silent), None);
    }
}
