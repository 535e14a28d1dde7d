//! A session that several threads use.

use super::{Controls, Session};
use crate::audio::{Speaker, VoiceInput};
use crate::hearing::SoundInput;
use crate::user::HeadInput;
use std::sync::{LockResult, Mutex, MutexGuard, TryLockResult};

/// A session with its inputs and controls side by side, for threads to share.
///
/// In an [`std::sync::Arc`], or by a handle of another language.
///
/// Pushes and settings never wait: they go around the session. What needs the session itself
/// (polls, resets, statistics) takes turns, by [`SharedSession::lock`] or
/// [`SharedSession::try_lock`].
#[derive(Debug)]
pub struct SharedSession {
    session: Mutex<Session>,
    agent: VoiceInput,
    user: VoiceInput,
    head: HeadInput,
    sounds: SoundInput,
    controls: Controls,
}

impl SharedSession {
    /// Shares `session`.
    pub fn new(session: Session) -> Self {
        Self {
            agent: session.voice_input(Speaker::Agent),
            user: session.voice_input(Speaker::User),
            head: session.head_input(),
            sounds: session.sounds(),
            controls: session.controls(),
            session: Mutex::new(session),
        }
    }

    /// A voice's input.
    pub fn voice(&self, speaker: Speaker) -> &VoiceInput {
        match speaker {
            Speaker::Agent => &self.agent,
            Speaker::User => &self.user,
        }
    }

    /// The input of the user's head.
    pub fn head(&self) -> &HeadInput {
        &self.head
    }

    /// The input of sounds in the room.
    pub fn sounds(&self) -> &SoundInput {
        &self.sounds
    }

    /// The settings.
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// The session itself, as soon as no other thread has it: up to a block's time.
    ///
    /// # Errors
    /// After a panic of a thread that had it: the session is of no more use.
    pub fn lock(&self) -> LockResult<MutexGuard<'_, Session>> {
        self.session.lock()
    }

    /// The session itself, if no other thread has it.
    ///
    /// # Errors
    /// While another thread has it, and as [`SharedSession::lock`].
    pub fn try_lock(&self) -> TryLockResult<MutexGuard<'_, Session>> {
        self.session.try_lock()
    }

    /// Whether a thread that had the session panicked.
    pub fn is_poisoned(&self) -> bool {
        self.session.is_poisoned()
    }
}
