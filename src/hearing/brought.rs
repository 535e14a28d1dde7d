//! What the host's own ears bring: two microphones where the agent's ears are.

use super::head::{Head, level};
use super::locate::Locator;
use crate::audio::{PairInput, Stream, VoiceStats};
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, FRAME_SAMPLES, SAMPLE_RATE};

/// What is louder than what goes on by this much stands out, dB.
const OVER: f64 = 6.0;
/// By how much what goes on may grow in a frame, dB: what does not end is background after a while.
const RISE: f64 = 0.1;
/// What is louder than what was before, faded, by this much is a sound of its own, dB.
const JUMP: f64 = 10.0;
/// What is quieter than what stands out by more than this says nothing of where it is, dB.
const RANGE: f64 = 20.0;
/// Where a direction is taken to be: metres away, metres over the floor. Two ears do not tell.
const FAR: f64 = 2.0;
const HIGH: f64 = 1.5;

/// How what stands out is told apart from the rest, in dB.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    /// What is quieter is not known.
    pub(super) known: f64,
    /// Fades by this a frame.
    pub(super) fade: f64,
    /// Frames for which a place stays known.
    pub(super) hold: u32,
}

/// The ears of a host, as the session hears them. Allocates when made and never after.
pub(super) struct Brought {
    stream: Stream<PairInput>,
    rules: Rules,
    locator: Locator,
    /// Left and right in turn.
    pairs: Box<[f32; 2 * BLOCK_SAMPLES]>,
    /// Whether the next pair that comes is a beginning.
    dry: bool,
    /// The block that the sound begins with.
    from: u64,
    /// Whether blocks went by unheard, or nothing came: what was before is cold.
    lost: bool,
    /// How much it stands out, dB SPL, and in each frame of the last block.
    salience: f64,
    course: [f64; BLOCK_FRAMES],
    /// Where it was taken to be in those frames.
    places: [Option<[f64; 3]>; BLOCK_FRAMES],
    /// What goes on, dB SPL.
    floor: f64,
    /// Frames since something stood out.
    since: u32,
    started: u64,
}

impl Brought {
    /// Holds `seconds` ahead; what is louder than `clip` is clipped.
    pub(super) fn new(seconds: usize, clip: f32, rules: Rules) -> Self {
        Self {
            stream: Stream::pairs(seconds * SAMPLE_RATE as usize, clip),
            rules,
            locator: Locator::new(),
            pairs: Box::new([0.0; 2 * BLOCK_SAMPLES]),
            dry: true,
            from: 0,
            lost: false,
            salience: f64::NEG_INFINITY,
            course: [f64::NEG_INFINITY; BLOCK_FRAMES],
            places: [None; BLOCK_FRAMES],
            floor: rules.known - OVER,
            since: u32::MAX,
            started: 0,
        }
    }

    pub(super) fn input(&self) -> &PairInput {
        self.stream.input()
    }

    /// Takes notice of what was pushed; `block` is due. Whether something begins with it.
    pub(super) fn begin(&mut self, block: u64) -> bool {
        self.dry |= self.stream.look();
        if !self.dry && self.from < block && self.stream.ahead() < self.pairs.len() as u64 {
            // The last pairs are with the resamplers, which wait for more.
            self.stream.input().finish();
            self.dry |= self.stream.look();
        }
        let begins = self.dry && self.stream.ahead() > 0;
        if begins {
            (self.dry, self.from, self.lost) = (false, block, true);
            self.started += 1;
        }
        begins
    }

    /// Takes what was brought for `block`; whether there is any.
    fn take(&mut self, block: u64) -> bool {
        if self.dry || self.from > block {
            return false;
        }
        if self.stream.take(&mut self.pairs[..]) < self.pairs.len() {
            self.dry = true;
            self.stream.input().run_dry();
        }
        true
    }

    /// Adds what was brought for `block` to both ears, `[4 frames]` each, of the heads of its
    /// frames.
    pub(super) fn hear(&mut self, block: u64, heads: &[Head; BLOCK_FRAMES], ears: &mut [[f32; BLOCK_SAMPLES]; 2]) {
        if !self.take(block) {
            return self.fade();
        }
        if std::mem::take(&mut self.lost) {
            self.locator.interrupt();
        }
        let mut frame = [[0.0; FRAME_SAMPLES]; 2];
        for (t, head) in heads.iter().enumerate() {
            let pairs = self.pairs[2 * t * FRAME_SAMPLES..][..2 * FRAME_SAMPLES].chunks_exact(2);
            for (i, pair) in pairs.enumerate() {
                for (side, sample) in pair.iter().enumerate() {
                    frame[side][i] = *sample;
                    ears[side][t * FRAME_SAMPLES + i] += *sample;
                }
            }
            self.judge(t, head, &frame);
        }
    }

    /// Says how much frame `t` stands out, and where it comes from.
    fn judge(&mut self, t: usize, head: &Head, frame: &[[f32; FRAME_SAMPLES]; 2]) {
        let loud = level(frame.as_flattened());
        let stands = loud >= self.rules.known && loud >= self.floor + OVER;
        self.floor = (self.floor + RISE).min(loud);
        self.salience -= self.rules.fade;
        let anew = stands && loud > self.salience + JUMP;
        if stands {
            self.salience = self.salience.max(loud);
            if self.since > self.rules.hold {
                self.locator.forget();
            }
        }
        self.since = if stands { 0 } else { self.since.saturating_add(1) };
        let told = stands && loud > self.salience - RANGE;
        self.locator.hear(frame.each_ref().map(|ear| &ear[..]), head, told, anew);
        let [x, _, z] = head.centre();
        self.places[t] = self.locator.azimuth().map(|azimuth| {
            let (sin, cos) = libm::sincos(azimuth);
            [x + FAR * sin, HIGH, z + FAR * cos]
        });
        self.course[t] = self.salience;
    }

    /// Four frames in which nothing is heard: what was, is where it was.
    fn fade(&mut self) {
        self.places = [self.places[BLOCK_FRAMES - 1]; BLOCK_FRAMES];
        for course in &mut self.course {
            self.salience -= self.rules.fade;
            *course = self.salience;
        }
        self.since = self.since.saturating_add(BLOCK_FRAMES as u32);
    }

    /// Lets `block` go by unheard.
    pub(super) fn skip(&mut self, block: u64) {
        self.lost |= self.take(block);
        self.fade();
    }

    /// How much frame `t` of the last block stands out, and where that is, if it is known.
    pub(super) fn told(&self, t: usize) -> Option<(f64, [f64; 3])> {
        self.places[t].map(|place| (self.course[t], place))
    }

    /// Nothing was pushed. Waits for a push that is under way.
    pub(super) fn reset(&mut self) {
        self.stream.reset();
        self.locator.forget();
        (self.dry, self.from, self.lost) = (true, 0, false);
        (self.salience, self.floor, self.since) = (f64::NEG_INFINITY, self.rules.known - OVER, u32::MAX);
        (self.course, self.places) = ([f64::NEG_INFINITY; BLOCK_FRAMES], [None; BLOCK_FRAMES]);
        self.started = 0;
    }

    /// Counters of both ears, and how often sound began.
    pub(super) fn stats(&self) -> (VoiceStats, u64) {
        (self.stream.stats(), self.started)
    }
}
