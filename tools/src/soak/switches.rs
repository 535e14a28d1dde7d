//! How well the steps of a governor are hidden: motion that changes its sampler again and again.

use super::{Voices, script::Script};
use crate::metrics::switch_seam;
use std::sync::Arc;
use visavis::replay::{Decision, Hold, Plan};
use visavis::{Engine, Governor, Result, Sampler, SessionOptions};

/// Blocks between two switches.
const STAY: u64 = 6;
/// Switches of a soak.
pub(super) const SWITCHES: u64 = 120;

/// Seam metric at `switches` switches of a session that goes up and down a governor's ladder, a
/// step every 0.8 s, in a conversation; `None` where nothing moves, or there is no ladder. Slots are up to date when they
/// are climbed to, as the governor sees to it: it changes time, not motion.
///
/// # Errors
/// Those of a session.
pub(super) fn measure(engine: &Arc<Engine>, voices: &Voices, switches: u64) -> Result<Option<f64>> {
    if engine.needs_sarah().is_err() {
        // There are no samplers.
        return Ok(None);
    }
    let last = if engine.config().student.is_some() { Sampler::Single } else { Sampler::Midpoint1 };
    let ladder = [Sampler::Midpoint4, Sampler::Midpoint2, last, Sampler::Midpoint2];
    let plan = |i: u64| Decision {
        block: i * STAY,
        plan: Plan { sampler: ladder[i as usize % 4], catch_up: None, anchor: true, hold: Hold::No },
    };
    let governor = Governor::Replay((0..=switches).map(plan).collect());
    let options = SessionOptions { governor, gaze: Some(0.8), ..SessionOptions::default() };
    let mut session = engine.session(options)?;
    let blocks = STAY * (switches + 1);
    let mut script = Script::new(voices, engine, Sampler::Midpoint4, blocks).of_one_sampler();
    let mut frames = Vec::new();
    for block in 0..blocks {
        script.block(&mut session, block)?;
        let made = session.poll(session.next_due())?.unwrap_or_default();
        made.last().into_iter().for_each(|frame| script.see(frame.root));
        frames.extend_from_slice(made);
    }
    Ok(switch_seam(&frames))
}
