//! What happens when in a cycle.

use glam::Vec3;
use visavis::{BLOCK_FRAMES, Engine, Error, ErrorKind, FPS, Result, Root, SAMPLE_RATE, Sampler, Session, Speaker};

/// What agent and user say, 24 kHz mono, repeated without end.
#[derive(Debug, Clone, PartialEq)]
pub struct Voices {
    agent: Vec<f32>,
    user: Vec<f32>,
}

impl Voices {
    /// Both voices, neither of them empty, full scale 1.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for an empty voice or samples that are not finite.
    pub fn new(agent: Vec<f32>, user: Vec<f32>) -> Result<Self> {
        if agent.is_empty() || user.is_empty() || !agent.iter().chain(&user).all(|s| s.is_finite()) {
            return Err(Error::new(ErrorKind::Argument, "a soak needs two voices of finite samples"));
        }
        Ok(Self { agent, user })
    }

    /// The agent's.
    pub(super) fn agent(&self) -> &[f32] {
        &self.agent
    }

    /// The user's.
    pub(super) fn user(&self) -> &[f32] {
        &self.user
    }
}

/// Sample rates of the two voices, one after the other.
const RATES: [u32; 5] = [24_000, 48_000, 16_000, 44_100, 8_000];
/// Gaze targets, one after the other.
const GAZES: [Option<f32>; 6] = [None, Some(0.8), Some(0.0), None, Some(1.0), Some(0.5)];

/// Plays a cycle again and again.
pub(super) struct Script<'a> {
    voices: &'a Voices,
    sampler: Sampler,
    student: bool,
    cycle: u64,
    /// Seconds of each voice pushed so far in this cycle.
    spoken: [f64; 2],
    samples: Vec<f32>,
    user: Option<Vec3>,
    agent: Root,
    part: Option<u64>,
}

impl<'a> Script<'a> {
    pub(super) fn new(voices: &'a Voices, engine: &Engine, sampler: Sampler, cycle: u64) -> Self {
        let student = engine.config().student.is_some();
        let samples = Vec::with_capacity(1 << 15);
        Self {
            voices,
            sampler,
            student,
            cycle,
            spoken: [0.0; 2],
            samples,
            user: None,
            agent: Root::default(),
            part: None,
        }
    }

    /// The same, leaving the sampler alone.
    pub(super) fn of_one_sampler(self) -> Self {
        Self { student: false, ..self }
    }

    /// Where the user is in the block that was prepared last, as far as the session was told.
    pub(super) fn user(&self) -> Option<Vec3> {
        self.user
    }

    /// Where the agent stands by now: the user stays near it.
    pub(super) fn see(&mut self, agent: Root) {
        self.agent = agent;
    }

    /// Does what the caller of `session` does before block `block` of the soak.
    pub(super) fn block(&mut self, session: &mut Session, block: u64) -> Result<()> {
        // Place in the cycle, 0 to 1, and in time.
        let at = (block % self.cycle) as f64 / self.cycle as f64;
        if block.is_multiple_of(self.cycle) {
            // Each cycle says the same where it does the same, so that cycles can be compared.
            self.spoken = [0.0; 2];
        }
        let part = (at * 20.0) as u64;
        if self.part.replace(part) != Some(part) {
            session.set_gaze(GAZES[part as usize % GAZES.len()])?;
            let cheap = self.student && (14..16).contains(&part);
            session.set_sampler(if cheap { Sampler::Single } else { self.sampler })?;
            session.voice_input(Speaker::User).set_present(part != 9);
        }
        let quiet = part == 6 || part == 17;
        let seconds = BLOCK_FRAMES as f64 / f64::from(FPS);
        self.speak(session, 0, if quiet { None } else { Some(RATES[part as usize / 2 % RATES.len()]) }, seconds)?;
        if part != 9 {
            self.speak(session, 1, if quiet { None } else { Some(RATES[part as usize / 3 % RATES.len()]) }, seconds)?;
        }
        self.walk(session, at, part)
    }

    /// A block of one voice at `rate`, or of silence.
    fn speak(&mut self, session: &mut Session, who: usize, rate: Option<u32>, seconds: f64) -> Result<()> {
        let voice = if who == 0 { &self.voices.agent } else { &self.voices.user };
        let rate_or = rate.unwrap_or(SAMPLE_RATE);
        let (from, to) = (self.spoken[who], self.spoken[who] + seconds);
        self.spoken[who] = to;
        let step = f64::from(SAMPLE_RATE) / f64::from(rate_or);
        // Sample n of a rate is at n / rate, wherever blocks begin.
        let (first, end) = ((from * f64::from(rate_or)).round() as u64, (to * f64::from(rate_or)).round() as u64);
        self.samples.clear();
        self.samples.extend((first..end).map(|n| {
            let place = n as f64 * step;
            let (i, part) = (place as u64, place.fract() as f32);
            let sample = |i: u64| voice[(i % voice.len() as u64) as usize];
            if rate.is_some() { sample(i) + part * (sample(i + 1) - sample(i)) } else { 0.0 }
        }));
        if who == 0 {
            session.push_agent_audio(&self.samples, rate_or)
        } else {
            session.push_user_audio(&self.samples, rate_or)
        }
    }

    /// The user's head, 120 times per second: around the agent, nearer and further, standing, gone,
    /// elsewhere at once.
    fn walk(&mut self, session: &mut Session, at: f64, part: u64) -> Result<()> {
        let now = session.next_due();
        if part == 3 || part == 12 {
            self.user = None;
            return Ok(());
        }
        let angle = match part {
            0..8 => std::f64::consts::TAU * 3.0 * at,
            8..12 => 2.0,
            // A teleport to the other side at the start of part 16.
            16.. => 5.0 + at,
            _ => 2.0 + 6.0 * (at - 0.6),
        };
        let distance = 1.4 + 0.5 * (std::f64::consts::TAU * 5.0 * at).sin();
        for i in 0..16 {
            let time = now + f64::from(i - 15) / 120.0;
            let head = Vec3::new(
                (self.agent.x + distance * angle.sin()) as f32,
                1.65 + 0.01 * (time * 2.0).sin() as f32,
                (self.agent.z + distance * angle.cos()) as f32,
            );
            session.push_user_head(head, time)?;
            self.user = Some(head);
        }
        Ok(())
    }
}
