//! The end of sounds in the room that is pushed into, from any thread.
//!
//! Each of 32 slots holds the stream of one source. A thread that pushes enters the slot of its
//! source, or takes one whose source is over, by one compare-and-swap; a slot that somebody is in
//! cannot be taken. So nobody waits, and no source's sound gets into another's.

use super::stats::Counts;
use crate::audio::{PairInput, VoiceInput, check_rate};
use crate::error::{Error, ErrorKind, Result};
use crate::queue::Queue;
use glam::Vec3;
use std::sync::Arc;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed};
use std::sync::atomic::{AtomicBool, AtomicU64};

/// Farthest coordinate of a source, metres: sessions may start that far out, and some more.
pub(super) const FARTHEST: f32 = 2e6;
/// Places of a source that wait for the next block; of more the newest stay.
const PLACES: usize = 8;
/// Attempts to enter a slot, or to make room for a place, before the push is given up: more threads
/// than that are at the same source at the same moment.
const ATTEMPTS: usize = 64;

/// The input of sounds in the room: pushes what sources give off, from any thread.
///
/// Also while the session computes a block: nothing here waits for a block or for another thread,
/// and nothing but the first pushes of a rate allocates. A block goes by what was pushed before its
/// poll began. A source's sound stands in the order in which it was pushed, and how it was cut does
/// not matter; one thread pushes a source's sound.
#[derive(Clone)]
pub struct SoundInput {
    shared: Option<Arc<Shared>>,
}

/// What both ends share.
pub(super) struct Shared {
    pub(super) slots: Box<[Slot]>,
    /// The host's own ears.
    pub(super) ears: PairInput,
    pub(super) counts: Counts,
}

/// Room for one source.
pub(super) struct Slot {
    /// An [`Owner`].
    owner: AtomicU64,
    /// Whether the source ran dry: what is pushed next is a sound of its own.
    pub(super) dry: AtomicBool,
    stream: VoiceInput,
    /// `x` and `y`, `z` and zero.
    places: Queue<2>,
}

/// Whose a slot is: from the lowest bit the source's id (32), how many threads are inside (8),
/// whether it is anybody's (1), and how often it has changed hands (23).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Owner(u64);

impl Owner {
    const INSIDE: u64 = 1 << 32;
    const TAKEN: u64 = 1 << 40;
    const CHANGE: u64 = 1 << 41;

    pub(super) fn id(self) -> Option<u32> {
        (self.0 & Self::TAKEN != 0).then_some(self.0 as u32)
    }

    fn inside(self) -> u64 {
        (self.0 / Self::INSIDE) & 0xff
    }

    pub(super) fn changes(self) -> u64 {
        self.0 / Self::CHANGE
    }

    /// The next owner, with the thread that takes the slot inside.
    fn next(self, id: u32) -> Self {
        Self((self.changes().wrapping_add(1)).wrapping_mul(Self::CHANGE) | Self::TAKEN | Self::INSIDE | u64::from(id))
    }

    fn nobody(self) -> Self {
        Self(self.changes().wrapping_add(1).wrapping_mul(Self::CHANGE))
    }
}

/// A thread in a slot, which stays its source's meanwhile.
struct Inside<'a>(&'a Slot);

impl Drop for Inside<'_> {
    fn drop(&mut self) {
        self.0.owner.fetch_sub(Owner::INSIDE, AcqRel);
    }
}

impl Slot {
    pub(super) fn new(stream: VoiceInput) -> Self {
        Self { owner: AtomicU64::new(0), dry: AtomicBool::new(true), stream, places: Queue::new(PLACES) }
    }

    pub(super) fn owner(&self) -> Owner {
        Owner(self.owner.load(Acquire))
    }

    fn swap(&self, from: Owner, to: Owner) -> bool {
        self.owner.compare_exchange(from.0, to.0, AcqRel, Relaxed).is_ok()
    }

    /// Enters it, if it is this source's.
    fn enter(&self, id: u32) -> Option<Inside<'_>> {
        for _ in 0..ATTEMPTS {
            let owner = self.owner();
            if owner.id() != Some(id) || owner.inside() == 0xff {
                return None;
            }
            if self.swap(owner, Owner(owner.0 + Owner::INSIDE)) {
                return Some(Inside(self));
            }
        }
        None
    }

    /// Takes it for a source, if it is nobody's, or, with `over`, if its source's sound is over.
    fn take(&self, id: u32, over: bool) -> Option<Inside<'_>> {
        let owner = self.owner();
        let free = match owner.id() {
            None => owner.inside() == 0,
            Some(_) => over && owner.inside() == 0 && self.dry.load(Acquire) && self.stream.is_drained(),
        };
        if !free || !self.swap(owner, owner.next(id)) {
            return None;
        }
        // Places that are still there are older than the first one of the new source.
        self.dry.store(true, Relaxed);
        Some(Inside(self))
    }

    fn place(&self, [x, y, z]: [f32; 3]) {
        let pair = |low: f32, high: f32| u64::from(low.to_bits()) | u64::from(high.to_bits()) << 32;
        for _ in 0..ATTEMPTS {
            if self.places.push(&[pair(x, y), pair(z, 0.0)]) {
                return;
            }
            // The newest counts.
            self.places.pop(&mut [0; 2]);
        }
    }

    /// The newest place that was told since the last look, if there is one.
    pub(super) fn last_place(&self) -> Option<[f64; 3]> {
        let (mut record, mut last) = ([0; 2], None);
        for _ in 0..2 * PLACES {
            if !self.places.pop(&mut record) {
                break;
            }
            let half = |word: u64| f64::from(f32::from_bits(word as u32));
            last = Some([half(record[0]), half(record[0] >> 32), half(record[1])]);
        }
        last
    }

    /// Nobody's, unless a thread is inside. The stream is empty already.
    pub(super) fn reset(&self) {
        while self.places.pop(&mut [0; 2]) {}
        self.dry.store(true, Relaxed);
        let owner = self.owner();
        if owner.inside() == 0 {
            self.swap(owner, owner.nobody());
        }
    }
}

impl SoundInput {
    /// The input of a session of a bundle without hearing.
    pub(crate) fn deaf() -> Self {
        Self { shared: None }
    }

    pub(super) fn new(shared: Arc<Shared>) -> Self {
        Self { shared: Some(shared) }
    }

    /// Pushes a piece of what source `id` gives off: mono `samples` of `rate` Hz (8000 to 192000),
    /// pascals as they are 1 m from it (RMS 1 is 94 dB SPL); `position` is where the source is from
    /// now on, world metres.
    ///
    /// The first piece of a source, and the first after it ran dry, sounds from the start of the
    /// next block on; further pieces follow it without a gap, up to ten seconds ahead (what is more
    /// is dropped and counted). An empty piece moves a source that sounds. Nearer than 0.3 m from
    /// the middle of the agent's head it is heard as from there. Sixteen sources sound at once: one
    /// more takes the place of the quietest at the head, if it is louder, else it is dropped and
    /// counted. So are new ones while 32 sound or wait for the next block.
    ///
    /// Samples that are not finite are silence, those beyond 64 pascals are clipped; both are
    /// counted ([`SoundStats`](super::SoundStats)).
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where the bundle has no hearing, and for a position that is not
    /// finite or beyond 2000 km along an axis (the sound is taken, where the source has a place
    /// already); [`ErrorKind::Audio`] for a rate out of range, of which nothing is taken, and for
    /// NaN or infinity among the samples, in whose place there is silence.
    pub fn push(&self, id: u32, samples: &[f32], rate: u32, position: Vec3) -> Result<()> {
        let Shared { slots, counts, .. } = self.shared()?;
        if let Err(e) = check_rate(rate) {
            counts.bad_rate.fetch_add(samples.len() as u64, Relaxed);
            return Err(e);
        }
        let known = position.is_finite() && position.abs().max_element() <= FARTHEST;
        let placed = if known {
            Ok(())
        } else {
            counts.bad_places.fetch_add(1, Relaxed);
            let message = format!("source {id} is at {position}: pass world metres, finite and within {FARTHEST} m");
            Err(Error::new(ErrorKind::Argument, message))
        };
        let own = slots.iter().find_map(|slot| slot.enter(id));
        let new = !samples.is_empty() && known;
        let take = |over| slots.iter().find_map(|slot| slot.take(id, over));
        let Some(slot) = own.or_else(|| if new { take(false).or_else(|| take(true)) } else { None }) else {
            counts.refused.fetch_add(u64::from(new), Relaxed);
            return placed;
        };
        counts.pieces.fetch_add(1, Relaxed);
        let Inside(Slot { dry, stream, .. }) = &slot;
        if known {
            // Before the sound: whoever sees that, sees where it is.
            slot.0.place(position.to_array());
        }
        if samples.is_empty() {
            return placed;
        }
        if dry.swap(false, AcqRel) {
            stream.begin();
        }
        placed.and(stream.push(samples, rate))
    }

    /// Stops source `id` at once: what no block has heard of it is dropped. Without effect where it
    /// does not sound.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where the bundle has no hearing.
    pub fn end(&self, id: u32) -> Result<()> {
        for inside in self.shared()?.slots.iter().filter_map(|slot| slot.enter(id)) {
            inside.0.stream.clear();
            inside.0.dry.store(true, Relaxed);
        }
        Ok(())
    }

    /// Pushes a piece of what two microphones at the agent's ears hear, pascals: as many samples of
    /// `left` as of `right`, of `rate` Hz (8000 to 192000). For hosts that do not know where sounds
    /// are: the direction is estimated.
    ///
    /// What they hear is added to what the sources give at the ears, and stands out by its own
    /// level, where that is 6 dB over what goes on. The ears are taken to be where those of the
    /// agent's shown head are, and to turn with it. Two ears tell one angle: until the head has
    /// turned, what is behind is taken to be before the face; as it turns, that is put right.
    /// Neither distance nor height is told: the place is 2 m away and 1.5 m over the floor.
    ///
    /// The first piece, and the first after the ears ran dry, is heard from the start of the next
    /// block on; further pieces follow without a gap, up to ten seconds ahead (what is more is
    /// dropped and counted). How they are cut does not matter, and left and right stay together
    /// whatever is dropped. One thread pushes ears at a time: what comes from another one meanwhile
    /// is dropped and counted. An empty piece changes nothing. Nothing but the first push of a rate
    /// allocates.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where the bundle has no hearing, and for ears of different lengths,
    /// of which nothing is taken; [`ErrorKind::Audio`] for a rate out of range, of which nothing is
    /// taken, and for NaN or infinity among the samples, in whose place there is silence.
    pub fn push_ears(&self, left: &[f32], right: &[f32], rate: u32) -> Result<()> {
        let Shared { ears, counts, .. } = self.shared()?;
        let pushed = ears.push(left, right, rate);
        let taken = left.len() == right.len() && check_rate(rate).is_ok() && !left.is_empty();
        counts.pieces.fetch_add(u64::from(taken), Relaxed);
        pushed
    }

    /// Ends what [`SoundInput::push_ears`] brought at once: what no block has heard of it is
    /// dropped.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] where the bundle has no hearing.
    pub fn end_ears(&self) -> Result<()> {
        self.shared()?.ears.clear();
        Ok(())
    }

    /// Whether sounds are heard at all: whether the bundle has hearing.
    pub fn is_heard(&self) -> bool {
        self.shared.is_some()
    }

    fn shared(&self) -> Result<&Shared> {
        self.shared.as_deref().ok_or_else(|| {
            let message = "this bundle has no hearing, so no sound is heard; load one that has (`visavis inspect` tells), or \
                           ask `Engine::has_hearing` first";
            Error::new(ErrorKind::Argument, message)
        })
    }
}

impl std::fmt::Debug for SoundInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let slots = self.shared.iter().flat_map(|shared| shared.slots.iter());
        let sources = slots.filter(|slot| slot.owner().id().is_some()).count();
        f.debug_struct("SoundInput").field("sources", &sources).finish_non_exhaustive()
    }
}
