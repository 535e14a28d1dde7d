//! Soak: hours of varied conversation as fast as they compute, judged.
//!
//! One session is driven through cycles of ten minutes in which everything changes: who speaks,
//! sample rates, silence, a missing voice, a lost tracker, gaze targets, a user who walks, stands
//! and teleports, samplers. A second session on the same engine runs beside it and is reset again
//! and again. Judged are
//!
//! | verdict | holds when |
//! |---|---|
//! | memory | resident memory, pages of files excepted, does not grow by more than 1 % over what it was in the second and third tenth of the run; a quarter of an hour is the least that says something, since voices fill their rings for a minute |
//! | allocations | computing a block allocates nothing after the first cycle's tenth (where the caller can count) |
//! | each metric (soaks of four cycles and more) | the mean over the last half of the cycles within 15 % of that over the first half, plus two standard errors of their difference, told from the spread within the halves (`drift`); the supporting foot's speed within 15 % of 2 cm/s where it is lower |
//! | period | the same noise and inputs 2^24 blocks (26 days) later give the same motion, bit for bit, over 40 blocks |
//! | precision | in the hours after a day the joints of one block on the same history move by no more (root mean square: 1.5 times, and 5 mm) than in the first hours |
//! | switches | where a governor's steps change the sampler the seam metric is at most 1.2 ([`crate::metrics::switch_seam`]) |
//! | guard | the motion is not defective ([`visavis::stats::GuardStats::is_defective`]) |
//!
//! | file | what |
//! |---|---|
//! | `script` | what happens when in a cycle |
//! | `hours` | what the hour changes, and why free runs a day apart say nothing |
//! | `switches` | motion that changes its sampler again and again |
//! | `drift` | a metric's drift, told from the spread between cycles |
//! | `window` | metrics over minutes of frames, in constant memory |
//! | `judge` | verdicts |

mod drift;
mod hours;
mod judge;
mod script;
mod switches;
mod window;

pub use hours::Hours;
pub use judge::{Report, Verdict};
pub use script::Voices;
pub use window::Figures;

use script::Script;
use std::sync::Arc;
use std::time::Instant;
use visavis::internals::session::Diagnostics;
use visavis::{BLOCK_FRAMES, Engine, Error, ErrorKind, FPS, Result, Sampler, Session, SessionOptions};
use window::Window;

/// Blocks of an hour of motion.
const HOUR: f64 = 3600.0 * FPS as f64 / BLOCK_FRAMES as f64;
/// Seconds of a cycle.
const CYCLE: f64 = 600.0;

/// What is soaked.
#[derive(Debug, Clone, PartialEq)]
pub struct Soak {
    /// Hours of motion, above 0.
    pub hours: f64,
    /// Hour of the session's time at which it starts, as if it had run that long.
    pub from_hour: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// The best sampler; the student is used for a part of each cycle if there is one.
    pub sampler: Sampler,
}

/// Counts allocations of the process so far, if the program can.
pub type Allocations = fn() -> u64;

impl Soak {
    /// Runs it; `voices` are what the two say, over and over, and `progress` is told the hours done
    /// now and then.
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for hours out of range; those of a session.
    pub fn run(
        &self,
        engine: &Arc<Engine>,
        voices: &Voices,
        allocations: Option<Allocations>,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Report> {
        if !(self.hours > 0.0 && self.hours <= 1000.0 && (0.0..=2000.0).contains(&self.from_hour)) {
            return Err(Error::new(ErrorKind::Argument, "hours above 0 up to 1000, from an hour of 0 to 2000"));
        }
        let blocks = ((self.hours * HOUR) as u64).max(30);
        // Short soaks have short cycles: three of them at least.
        let cycle = ((CYCLE * HOUR / 3600.0) as u64).min(blocks / 3).max(10);
        let options = SessionOptions {
            seed: self.seed,
            sampler: self.sampler,
            diagnostics: Diagnostics { first_block: (self.from_hour * HOUR) as u64, ..Default::default() },
            ..SessionOptions::default()
        };
        let mut session = engine.session(options.clone())?;
        let mut second =
            engine.session(SessionOptions { seed: self.seed + 1, diagnostics: Diagnostics::default(), ..options })?;
        let mut script = Script::new(voices, engine, self.sampler, cycle);
        let (mut window, mut cycles) = (Window::new(&engine.config().rig), Vec::new());
        let warm = (cycle / 10).max(10);
        let (mut allocated, mut memory) = (0, judge::Memory::default());
        let started = Instant::now();
        for block in 0..blocks {
            script.block(&mut session, block)?;
            let before = allocations.map(|count| count());
            let due = session.next_due();
            let frames = session.poll(due)?.unwrap_or_default();
            if let (Some(count), true) = (allocations, block >= warm) {
                allocated += count() - before.unwrap_or_default();
            }
            if let Some(last) = frames.last() {
                script.see(last.root);
            }
            window.take(frames, script.user());
            if block % cycle == cycle - 1 {
                cycles.push(window.finish());
            }
            if block % 8 == 0 {
                besides(&mut second, block)?;
            }
            if block % 64 == 0 {
                memory.sample(block as f64 / blocks as f64);
                progress(block as f64 / HOUR);
            }
        }
        memory.sample(1.0);
        let seconds = started.elapsed().as_secs_f64();
        let stats = session.stats();
        let hours = Hours::measure(engine, voices, self.sampler)?;
        let switches = switches::measure(engine, voices, switches::SWITCHES)?;
        let measured = judge::Measured {
            blocks,
            seconds,
            stats,
            cycles,
            memory,
            allocations: allocations.map(|_| allocated),
            hours,
            switches,
        };
        Ok(judge::report(self, measured))
    }
}

/// The second session: a block now and then, a fresh start every few minutes.
fn besides(session: &mut Session, block: u64) -> Result<()> {
    let due = session.next_due();
    session.poll(due)?;
    if block % 1200 == 1192 { session.reset() } else { Ok(()) }
}

#[cfg(test)]
mod tests;
