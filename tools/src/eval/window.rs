//! Which parts of the clips are measured.

use super::clip::{Clip, Segment};
use crate::metrics::is_speaking;
use visavis::{Error, ErrorKind, Result};

/// Frames that are measured, as many as SARAH's test sequences have (13.3 s).
pub const WINDOW: usize = 400;
/// Frames before them that are generated and not measured: a session starts from its idle clip, not
/// from the clip's pose (2 s).
pub const LEAD: usize = 60;

/// A stretch of a clip: [`LEAD`] frames that lead in, then [`WINDOW`] frames.
#[derive(Debug, Clone)]
pub struct Window {
    /// Which of the clips it is from.
    pub clip: usize,
    /// The first measured frame in that clip.
    pub first: usize,
    /// Lead and window together.
    pub segment: Segment,
    /// The measured frames alone: the corpus' own motion.
    pub truth: Segment,
    /// Whether the agent speaks in at least half of them.
    pub speaking: bool,
}

impl Window {
    /// At most `count` windows of `clips`, without overlap and evenly spread over all that there
    /// are.
    ///
    /// # Errors
    /// Those of [`Clip::read`]; [`ErrorKind::Argument`] when no clip is long enough.
    pub fn choose(clips: &[Clip], count: usize) -> Result<Vec<Self>> {
        let all: Vec<_> = Self::places(clips).collect();
        if all.is_empty() || count == 0 {
            let message = format!("no clip has the {} frames ({} s) of a window", LEAD + WINDOW, (LEAD + WINDOW) / 30);
            return Err(Error::new(ErrorKind::Argument, message));
        }
        let count = count.min(all.len());
        let chosen = (0..count).map(|i| all[(2 * i + 1) * all.len() / (2 * count)]);
        chosen.map(|(c, from)| Self::read(&clips[c], c, from)).collect()
    }

    /// Every window of `clips`, read one after the other.
    ///
    /// # Errors
    /// Those of [`Clip::read`].
    pub fn every(clips: &[Clip]) -> impl Iterator<Item = Result<Self>> {
        Self::places(clips).map(|(c, from)| Self::read(&clips[c], c, from))
    }

    /// Clip and first frame of every window.
    fn places(clips: &[Clip]) -> impl Iterator<Item = (usize, usize)> {
        let length = LEAD + WINDOW;
        (clips.iter().enumerate()).flat_map(move |(c, clip)| (0..clip.frames() / length).map(move |i| (c, i * length)))
    }

    fn read(clip: &Clip, index: usize, from: usize) -> Result<Self> {
        let segment = clip.read(from, LEAD + WINDOW)?;
        let truth = segment.cut(LEAD, LEAD + WINDOW);
        let speaking = truth.agent().is_some_and(|voice| is_speaking(&voice, WINDOW));
        Ok(Self { clip: index, first: from + LEAD, segment, truth, speaking })
    }
}
