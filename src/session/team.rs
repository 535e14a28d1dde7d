//! Several sessions stepped together: their rows share each pass over the flow network's weights.

use super::Session;
use super::block::Block;
use super::governor::{Hold, Plan};
use super::maker::Maker;
use super::pipeline::{LATENTS, MEMBERS, compute};
use super::tools::{Tools, Workspace};
use crate::clock::Instant;
use crate::engine::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::flow::SHARED_ROWS;
use crate::kernels::Exec;
use std::sync::Arc;

/// Steps several sessions of one engine together: threads and working memory.
///
/// Reading the weights is most of a block's time. Sessions whose blocks are due at the same time,
/// and made by the same sampler with history at the same flow times, go through the flow network
/// and the decoder side by side, in the flow network up to 16 rows per pass: four without a gaze
/// target, two with one, eight on the single-step student. Sessions of the kind `dram` go side by
/// side, up to 64 per pass over all weights. The others are computed one after the other. What each session shows has the bits that [`Session::poll`] gives.
///
/// A team has threads of its own: make the sessions with one thread.
///
/// ```no_run
/// use visavis::{Engine, SessionOptions};
///
/// # fn main() -> visavis::Result<()> {
/// let engine = Engine::load("models/visavis-room-i8.safetensors")?;
/// let mut team = engine.team(2)?;
/// let mut a = engine.session(SessionOptions { seed: 1, ..SessionOptions::default() })?;
/// let mut b = engine.session(SessionOptions { seed: 2, ..SessionOptions::default() })?;
/// let now = 0.0;
/// while team.step(&mut [(&mut a, now), (&mut b, now)])? > 0 {
///     let heads = [&a, &b].map(|session| session.frames().map(|frames| frames[0].global[0]));
///     println!("{heads:?}");
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Team {
    engine: Arc<Engine>,
    exec: Exec,
    work: Workspace,
    shared: u64,
}

/// A session's block between the decision about it and its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Due {
    plan: Plan,
    work: f64,
}

impl Team {
    pub(crate) fn new(engine: Arc<Engine>, threads: usize) -> Result<Self> {
        let exec = engine.exec(threads)?;
        let work = Workspace::new(&engine, MEMBERS, LATENTS);
        Ok(Self { engine, exec, work, shared: 0 })
    }

    /// Blocks so far that shared their passes with another session's.
    pub fn shared_blocks(&self) -> u64 {
        self.shared
    }

    /// Computes the next block of each session that is due at its session time (seconds) and
    /// returns how many those were; their frames are in [`Session::frames`]. Call it until it
    /// returns 0, as [`Session::poll`].
    ///
    /// The time that it takes counts for each of them in equal parts ([`Session::stats`], and what
    /// a governor goes by).
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a session of another engine, or a time that is not finite,
    /// [`ErrorKind::State`] for a time before an earlier one: nothing is computed then. Errors of
    /// one session's block, as of [`Session::poll`], come out after the others' blocks are done.
    pub fn step(&mut self, sessions: &mut [(&mut Session, f64)]) -> Result<usize> {
        for (session, now) in &*sessions {
            if !Arc::ptr_eq(&session.engine, &self.engine) {
                return Err(Error::new(ErrorKind::Argument, "a team steps sessions of the engine that made it"));
            }
            session.check_time(*now)?;
        }
        let mut due = 0;
        for (session, now) in &mut *sessions {
            session.due = None;
            if session.is_due(*now)? {
                let (plan, work) = session.start();
                session.due = Some(Due { plan, work });
                due += 1;
            }
        }
        if due == 0 {
            return Ok(0);
        }
        let mut outcome = Ok(());
        let started = Instant::now();
        self.exec.begin();
        let mut tools = Tools { exec: &mut self.exec, work: &mut self.work, engine: &self.engine };
        while let Some(mut blocks) = gather(sessions) {
            let count = compute(&mut tools, &mut blocks);
            self.shared += if count > 1 { count as u64 } else { 0 };
            for block in blocks.into_iter().flatten() {
                outcome = outcome.and(block.outcome);
            }
        }
        self.exec.end();
        let share = started.elapsed() / due;
        for (session, _) in sessions {
            if let Some(Due { plan, work }) = session.done.take() {
                session.ended(plan, work, share);
            }
        }
        outcome.map(|()| due as usize)
    }
}

/// The block of the first session that is due, and those of sessions that can share its passes;
/// `None` when all are done.
fn gather<'a>(sessions: &'a mut [(&mut Session, f64)]) -> Option<[Option<Block<'a>>; MEMBERS]> {
    let mut blocks: [Option<Block<'a>>; MEMBERS] = [const { None }; MEMBERS];
    let (mut count, mut left) = (0, 0);
    for (session, _) in sessions {
        let Some(Due { plan, .. }) = session.due else { continue };
        let rows = session.shared_rows(&plan);
        left = match &blocks[0] {
            // A session that shares with nobody leaves no room.
            None => session.room().saturating_sub(rows.unwrap_or(session.room())),
            Some(first) => {
                let same = match (&first.state.maker, &session.state.maker) {
                    (Maker::Latent(a), Maker::Latent(b)) => {
                        first.plan.sampler == plan.sampler && a.generator.alike(&b.generator, plan.sampler)
                    }
                    (Maker::Step(_), Maker::Step(_)) => true,
                    _ => false,
                };
                match rows.and_then(|rows| left.checked_sub(rows)) {
                    Some(rest) if same && count < MEMBERS => rest,
                    _ => continue,
                }
            }
        };
        session.done = session.due.take();
        let Session { options, state, .. } = &mut **session;
        blocks[count] = Some(Block { options, plan, state, probe: None, outcome: Ok(()) });
        count += 1;
    }
    (count > 0).then_some(blocks)
}

impl Session {
    /// Rows of a pass that the block of `plan` takes; `None` where it cannot share one.
    fn shared_rows(&self, plan: &Plan) -> Option<usize> {
        let rows = match &self.state.maker {
            Maker::Latent(maker) => {
                let gaze = self.options.diagnostics.gaze_control.guides(self.options.gaze);
                maker.generator.rows(plan.sampler, gaze)?
            }
            Maker::Step(_) => 1,
        };
        (plan.hold == Hold::No).then_some(rows)
    }

    /// Rows that a pass has room for.
    fn room(&self) -> usize {
        match &self.state.maker {
            Maker::Latent(_) => SHARED_ROWS,
            Maker::Step(_) => MEMBERS,
        }
    }
}
