//! The sources that sound: which of those that are pushed are heard, and which stands out.

use super::brought::{Brought, Rules};
use super::head::{Head, PAST, Trail, level};
use super::input::{Shared, Slot, SoundInput};
use super::stats::{Counts, SoundStats};
use crate::audio::Stream;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FRAME_SAMPLES, SAMPLE_RATE};
use std::sync::Arc;
use std::sync::atomic::Ordering::Release;

/// Sources that sound at once.
pub(super) const SOUNDING: usize = 16;
/// Those and new ones, which wait for the next block.
const SLOTS: usize = 32;
/// Sound that a source may be ahead, seconds.
const SECONDS: usize = 10;
/// Samples beyond this are clipped: 130 dB SPL.
const CLIP: f32 = 64.0;
/// Records that wait while another thread is in a source's input.
const INBOX: usize = 128;
/// What stands out by less than this is not known, dB SPL at the head.
pub(super) const KNOWN: f64 = 35.0;
/// What stood out fades by this much a frame, dB.
const FADE: f64 = 1.5;
/// Frames for which the place of what stood out last stays known.
const HOLD: u32 = 60;

/// A slot as the reader knows it.
struct Reading {
    stream: Stream,
    /// How often the slot had changed hands, and whose it is.
    changes: u64,
    id: Option<u32>,
    place: Option<[f64; 3]>,
    /// Whether the next sample that comes is a beginning.
    dry: bool,
    /// The block that the sound begins with.
    from: u64,
}

/// A source that sounds, or did lately.
#[derive(Debug, Clone)]
struct Source {
    id: u32,
    /// The slot of its sound, while there is any.
    slot: Option<usize>,
    place: [f64; 3],
    /// How much it stands out, dB SPL at the head; as long as it has not begun, by its first frame.
    salience: f64,
    /// The same in each frame of the last block.
    course: [f64; BLOCK_FRAMES],
    /// Whether it has not begun, and did not sound lately either.
    new: bool,
    trail: Trail,
    /// Whether its sound is over but for what the ears have not heard yet.
    rings: bool,
    /// Whether blocks went by unheard: the trail is cold.
    lost: bool,
}

impl Source {
    /// Four frames in which nothing of it is heard.
    fn fade(&mut self) {
        for course in &mut self.course {
            self.salience -= FADE;
            *course = self.salience;
        }
    }
}

/// All sources of a session. Allocates when made and never after.
pub(super) struct Sources {
    shared: Arc<Shared>,
    readings: Vec<Reading>,
    /// Up to [`SOUNDING`], in the order in which they began; those that began with one block in
    /// that of their ids. Which slots they are in does not matter.
    sources: Vec<Source>,
    /// What a host's own ears bring.
    brought: Brought,
    /// A source's sound: [`PAST`] samples before a block, and the block.
    sound: Box<[f32; PAST + BLOCK_SAMPLES]>,
    /// The block that the first sound of all began with.
    first: Option<u64>,
    /// What stood out last, while it is known, and the frames since then.
    salient: Option<[f64; 3]>,
    since: u32,
    started: u64,
    refused: u64,
    replaced: u64,
}

impl Sources {
    pub(super) fn new() -> Self {
        let streams: Vec<_> = (0..SLOTS).map(|_| Stream::new(SECONDS * SAMPLE_RATE as usize, CLIP, INBOX)).collect();
        let slots = streams.iter().map(|stream| Slot::new(stream.input().clone())).collect();
        let reading = |stream| Reading { stream, changes: 0, id: None, place: None, dry: true, from: 0 };
        let brought = Brought::new(SECONDS, CLIP, Rules { known: KNOWN, fade: FADE, hold: HOLD });
        let ears = brought.input().clone();
        Self {
            shared: Arc::new(Shared { slots, ears, counts: Counts::default() }),
            readings: streams.into_iter().map(reading).collect(),
            sources: Vec::with_capacity(SOUNDING),
            brought,
            sound: Box::new([0.0; PAST + BLOCK_SAMPLES]),
            first: None,
            salient: None,
            since: 0,
            started: 0,
            refused: 0,
            replaced: 0,
        }
    }

    pub(super) fn input(&self) -> SoundInput {
        SoundInput::new(Arc::clone(&self.shared))
    }

    /// Whether any sound has begun by `block`.
    pub(super) fn have_begun(&self, block: u64) -> bool {
        self.first.is_some_and(|first| first <= block)
    }

    /// Takes notice of what was pushed: `block`, which is due, hears that and no more, and what is
    /// new begins to sound with it. `near` is about where the agent's head is.
    pub(super) fn begin(&mut self, block: u64, near: [f64; 3]) {
        if self.brought.begin(block) {
            self.first.get_or_insert(block);
        }
        let (mut fresh, mut count) = ([(0, 0); SLOTS], 0);
        for (i, (reading, slot)) in self.readings.iter_mut().zip(&self.shared.slots).enumerate() {
            let owner = slot.owner();
            let changed = reading.changes != owner.changes();
            // The sound first: who sees it, sees where it is.
            let cut = reading.stream.look();
            // A slot that changed hands meanwhile is looked at with the next block.
            let late = slot.owner().changes() != owner.changes();
            if changed {
                (reading.changes, reading.id, reading.place) = (owner.changes(), owner.id(), None);
            }
            let over = changed || cut || late;
            reading.dry |= over;
            let place = if late { None } else { slot.last_place() };
            reading.place = place.or(reading.place);
            if let Some(source) = self.sources.iter_mut().find(|source| source.slot == Some(i)) {
                source.slot = source.slot.filter(|_| !over);
                source.place = place.filter(|_| !over).unwrap_or(source.place);
            }
            if late {
                continue;
            }
            if !reading.dry && reading.from < block && reading.stream.ahead() < BLOCK_SAMPLES as u64 {
                // The last samples are with the resampler, which waits for more.
                reading.stream.input().finish();
                reading.stream.look();
            }
            if let (true, Some(id), Some(_), 1..) = (reading.dry, reading.id, reading.place, reading.stream.ahead()) {
                fresh[count] = (id, i);
                count += 1;
            }
        }
        let fresh = &mut fresh[..count];
        fresh.sort_unstable();
        for (id, slot) in fresh {
            self.admit(*id, *slot, block, near);
        }
    }

    /// Lets what is in `slot` sound from `block` on, if it is among the loudest.
    fn admit(&mut self, id: u32, slot: usize, block: u64, near: [f64; 3]) {
        let Some(place) = self.readings[slot].place else { return };
        let before = self.sources.iter_mut().find(|source| source.id == id && source.slot.is_none());
        if let Some(source) = before {
            (source.slot, source.place) = (Some(slot), place);
        } else {
            let first = &mut self.sound[..FRAME_SAMPLES];
            self.readings[slot].stream.peek(first);
            let loud = level(first) - 20.0 * libm::log10(distance(place, near));
            if self.sources.len() == SOUNDING {
                // What is over gives way first.
                let key = |source: &Source| (source.slot.is_some(), source.salience);
                let least = (0..SOUNDING).reduce(|a, b| {
                    let ((a_sounds, a_loud), (b_sounds, b_loud)) = (key(&self.sources[a]), key(&self.sources[b]));
                    if (b_sounds, b_loud) < (a_sounds, a_loud) { b } else { a }
                });
                let least = least.unwrap_or(0);
                let other = self.sources[least].slot;
                if other.is_some() && self.sources[least].salience >= loud {
                    self.refused += 1;
                    return self.drop_sound(slot);
                }
                if let Some(other) = other {
                    self.replaced += 1;
                    self.drop_sound(other);
                }
                self.sources.remove(least);
            }
            let (slot, trail) = (Some(slot), Trail::default());
            let course = [loud; BLOCK_FRAMES];
            let source =
                Source { id, slot, place, salience: loud, course, new: true, trail, rings: false, lost: false };
            self.sources.push(source);
        }
        self.started += 1;
        self.first.get_or_insert(block);
        let reading = &mut self.readings[slot];
        (reading.dry, reading.from) = (false, block);
    }

    /// Drops what has been noticed of the sound in `slot`.
    fn drop_sound(&mut self, slot: usize) {
        let reading = &mut self.readings[slot];
        reading.stream.pass(u64::MAX);
        reading.dry = true;
        self.shared.slots[slot].dry.store(true, Release);
    }

    /// Adds what all sources give off in `block`, and what a host's ears bring, to both ears, each
    /// `[4 frames]`, of the heads of its frames.
    pub(super) fn hear(&mut self, block: u64, heads: &[Head; BLOCK_FRAMES], ears: &mut [[f32; BLOCK_SAMPLES]; 2]) {
        for i in 0..self.sources.len() {
            let Some(begins) = self.take(i, block) else { continue };
            let source = &mut self.sources[i];
            if begins || source.lost {
                (source.trail, source.lost) = (Trail::default(), false);
                self.sound[..PAST].fill(0.0);
            } else {
                self.sound[..PAST].copy_from_slice(&source.trail.past);
            }
            if std::mem::take(&mut source.new) {
                source.salience = f64::NEG_INFINITY;
            }
            let [left, right] = &mut *ears;
            let frames = left.chunks_exact_mut(FRAME_SAMPLES).zip(right.chunks_exact_mut(FRAME_SAMPLES));
            for (t, ((left, right), head)) in frames.zip(heads).enumerate() {
                let sound = &self.sound[t * FRAME_SAMPLES..][..PAST + FRAME_SAMPLES];
                let path = head.path(source.place);
                source.trail.add(&path, sound, [left, right]);
                let loud = level(&sound[PAST..]) - 20.0 * libm::log10(path.distance);
                source.salience = loud.max(source.salience - FADE);
                source.course[t] = source.salience;
            }
            source.trail.past.copy_from_slice(&self.sound[BLOCK_SAMPLES..]);
        }
        self.brought.hear(block, heads, ears);
        self.judge();
    }

    /// Lets `block` go by unheard.
    pub(super) fn skip(&mut self, block: u64) {
        for i in 0..self.sources.len() {
            if self.take(i, block).is_some() {
                let source = &mut self.sources[i];
                source.fade();
                (source.rings, source.lost) = (false, true);
            }
        }
        self.brought.skip(block);
        self.judge();
    }

    /// Takes what source `i` gives off in `block` to `sound`; whether it begins with that block,
    /// or none where it is silent, and fades.
    fn take(&mut self, i: usize, block: u64) -> Option<bool> {
        let source = &mut self.sources[i];
        let sound = &mut self.sound[PAST..];
        let sounds = source.slot.filter(|slot| self.readings[*slot].from <= block);
        if let Some(slot) = sounds {
            let reading = &mut self.readings[slot];
            if reading.stream.take(sound) < sound.len() {
                reading.dry = true;
                self.shared.slots[slot].dry.store(true, Release);
                (source.slot, source.rings) = (None, true);
            }
            return Some(reading.from == block);
        }
        if std::mem::take(&mut source.rings) {
            sound.fill(0.0);
            return Some(false);
        }
        if !source.new {
            source.fade();
        }
        None
    }

    /// Says what stood out in the frames of a block, and forgets sources that are over and do not
    /// any more.
    fn judge(&mut self) {
        for t in 0..BLOCK_FRAMES {
            let heard = self.sources.iter().filter(|source| !source.new);
            let most = heard.reduce(|a, b| if b.course[t] > a.course[t] { b } else { a });
            let most = most.map(|source| (source.course[t], source.place));
            let most = [most, self.brought.told(t)].into_iter().flatten().reduce(|a, b| if b.0 > a.0 { b } else { a });
            if let Some((_, place)) = most.filter(|(course, _)| *course >= KNOWN) {
                (self.salient, self.since) = (Some(place), 0);
            } else {
                self.since = self.since.saturating_add(1);
            }
        }
        if self.since > HOLD {
            self.salient = None;
        }
        self.sources.retain(|source| source.slot.is_some() || source.rings || source.salience >= KNOWN);
    }

    /// Where what stood out last is, if it is known.
    pub(super) fn salient(&self) -> Option<[f64; 3]> {
        self.salient
    }

    /// No sources, nothing pushed. Waits for pushes that are under way.
    pub(super) fn reset(&mut self) {
        for (reading, slot) in self.readings.iter_mut().zip(&self.shared.slots) {
            reading.stream.reset();
            slot.reset();
            (reading.changes, reading.id) = (slot.owner().changes(), slot.owner().id());
            (reading.place, reading.dry, reading.from) = (None, true, 0);
        }
        self.brought.reset();
        self.shared.counts.reset();
        self.sources.clear();
        (self.first, self.salient, self.since) = (None, None, 0);
        (self.started, self.refused, self.replaced) = (0, 0, 0);
    }

    pub(super) fn stats(&self) -> SoundStats {
        let (ears, begun) = self.brought.stats();
        let streams = self.readings.iter().map(|reading| reading.stream.stats()).chain([ears]);
        let mut stats = SoundStats::of(&self.shared.counts, streams);
        stats.started = self.started + begun;
        stats.refused += self.refused;
        stats.replaced = self.replaced;
        stats
    }
}

/// Metres between two places, at least those that are heard.
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = [0, 1, 2].map(|i| a[i] - b[i]);
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt().max(crate::audio::head::NEAREST)
}
