//! A conversation of whole blocks, played to sessions as a live caller would.

use super::argument;
use crate::error::Result;
use crate::frame::{BLOCK_SAMPLES, SAMPLE_RATE};
use crate::session::Session;
use glam::Vec3;

/// A conversation of whole blocks.
#[derive(Debug, Clone)]
pub struct Scene {
    agent: Option<Vec<f32>>,
    user: Option<Vec<f32>>,
    /// The user's head: session time, seconds, and place, world metres.
    heads: Vec<(f64, Vec3)>,
    blocks: usize,
    gaze: Option<f32>,
    sounds: Vec<Sound>,
}

/// A sound in the room.
#[derive(Debug, Clone)]
pub struct Sound {
    /// Number of its source.
    pub id: u32,
    /// Where it is, world metres.
    pub place: Vec3,
    /// The block that it begins with.
    pub block: usize,
    /// 24 kHz, pascals as they are 1 m from it.
    pub samples: Vec<f32>,
}

impl Scene {
    /// `blocks` blocks: voices (24 kHz mono, sample `n` at `n / 24000` s; `None` is absent, and one
    /// that ends is silent from there), the user's head as a tracker would send it (seconds in
    /// ascending order, world metres), and a gaze target or none.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`](crate::error::ErrorKind::Argument) for 0 blocks.
    pub fn new(
        agent: Option<&[f32]>,
        user: Option<&[f32]>,
        heads: Vec<(f64, Vec3)>,
        blocks: usize,
        gaze: Option<f32>,
    ) -> Result<Self> {
        if blocks == 0 {
            return Err(argument("the conversation is shorter than a block of four frames".to_owned()));
        }
        let voice = |voice: &[f32]| voice[..voice.len().min(blocks * BLOCK_SAMPLES)].to_vec();
        Ok(Self { agent: agent.map(voice), user: user.map(voice), heads, blocks, gaze, sounds: Vec::new() })
    }

    /// The same with sounds in the room, which are for bundles with hearing; others get none.
    #[must_use]
    pub fn with_sounds(self, sounds: Vec<Sound>) -> Self {
        Self { sounds, ..self }
    }

    /// The same user and length with the two voices exchanged: a conversation that nothing was
    /// chosen by.
    #[must_use]
    pub fn exchanged(&self) -> Self {
        Self { agent: self.user.clone(), user: self.agent.clone(), ..self.clone() }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    /// The sounds in the room.
    pub fn sounds(&self) -> &[Sound] {
        &self.sounds
    }

    /// The gaze target.
    pub fn gaze(&self) -> Option<f32> {
        self.gaze
    }

    /// Plays it to a session at its start, through the session's own inputs; `made` is called after
    /// each block, with its number.
    ///
    /// # Errors
    /// Those of pushing and polling, and of `made`.
    pub fn play(&self, session: &mut Session, mut made: impl FnMut(&mut Session, usize) -> Result<()>) -> Result<()> {
        let mut heads = self.heads.iter().peekable();
        let sounds = if session.engine().has_hearing() { &self.sounds[..] } else { &[] };
        let chunk = |voice: &Option<Vec<f32>>, block: usize| -> Option<Vec<f32>> {
            Some(voice.as_ref()?.chunks(BLOCK_SAMPLES).nth(block)?.to_vec())
        };
        for block in 0..self.blocks {
            let now = session.next_due();
            if let Some(samples) = chunk(&self.agent, block) {
                session.push_agent_audio(&samples, SAMPLE_RATE)?;
            }
            if let Some(samples) = chunk(&self.user, block) {
                session.push_user_audio(&samples, SAMPLE_RATE)?;
            }
            while let Some((time, position)) = heads.next_if(|(time, _)| *time <= now) {
                session.push_user_head(*position, *time)?;
            }
            for Sound { id, place, block: first, samples } in sounds {
                let piece = block.checked_sub(*first).and_then(|i| samples.chunks(BLOCK_SAMPLES).nth(i));
                if let Some(samples) = piece {
                    session.push_sound(*id, samples, SAMPLE_RATE, *place)?;
                }
            }
            session.poll(now)?;
            made(session, block)?;
        }
        Ok(())
    }
}
