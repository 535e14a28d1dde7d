//! Several sessions stepped together: their rows share each pass over the flow network's weights.

use super::Session;
use super::block::BlockState;
use super::governor::{Hold, Plan};
use super::inputs::listen;
use crate::engine::Engine;
use crate::error::{Error, ErrorKind, Result};
use crate::flow::{SHARED_ROWS, SharedPass};
use crate::kernels::Exec;
use crate::vae::{Decoding, SharedDecoding};
use std::sync::Arc;
use std::time::Instant;

/// Sessions of one shared pass, at most: two rows each is the least.
const MEMBERS: usize = SHARED_ROWS / 2;

/// What it takes to step several sessions of one engine together: threads and working memory.
///
/// Reading the weights is most of a block's time. Sessions whose blocks are due at the same time, and made by the same
/// sampler with history at the same flow times, go through the flow network and the decoder side by side, in the flow
/// network up to 16 rows a pass: four without a gaze target, two with one, eight on the single-step student. The
/// others are computed one after the other. What each session shows has the bits that
/// [`Session::poll`] gives.
///
/// A team has threads of its own: make the sessions with one thread.
///
/// ```no_run
/// # fn main() -> visavis::error::Result<()> {
/// use visavis::engine::Engine;
/// use visavis::session::SessionOptions;
///
/// let engine = Engine::load("models/visavis-base-i8.safetensors")?;
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
    pass: SharedPass,
    decoder: SharedDecoding,
    shared: u64,
}

/// A session's block between the decision about it and its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Due {
    plan: Plan,
    work: f64,
}

/// A session and its time.
type Member<'a, 's> = &'a mut (&'s mut Session, f64);

impl Team {
    pub(crate) fn new(engine: Arc<Engine>, threads: usize) -> Result<Self> {
        let exec = engine.exec(threads)?;
        let pass = SharedPass::new(engine.nets());
        let decoder = engine.decoder.shared(MEMBERS);
        Ok(Self { engine, exec, pass, decoder, shared: 0 })
    }

    /// Blocks so far that shared their passes with another session's.
    pub fn shared_blocks(&self) -> u64 {
        self.shared
    }

    /// Computes the next block of each session that is due at its session time (seconds) and returns how many those were; their
    /// frames are in [`Session::frames`]. Call it until it returns 0, as [`Session::poll`].
    ///
    /// The time that it takes counts for each of them in equal parts ([`Session::stats`], and what a governor goes by).
    ///
    /// # Errors
    /// [`ErrorKind::Argument`] for a session of another engine, or a time that is not finite, [`ErrorKind::State`] for a time before an
    /// earlier one: nothing is computed then. Errors of one session's block, as of [`Session::poll`], come out after the others' blocks are
    /// done.
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
        while let Some(members) = gather(sessions) {
            let done = self.block(members);
            if outcome.is_ok() {
                outcome = done;
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

    /// One block of each of `members`, which can share passes. Allocates nothing, takes no lock, makes no system call.
    #[cfg_attr(visavis_rtsan, sanitize(realtime = "nonblocking"))]
    fn block(&mut self, mut members: [Option<Member<'_, '_>>; MEMBERS]) -> Result<()> {
        let Self { engine, exec, pass, decoder, shared } = self;
        let mut outcome = Ok(());
        let mut keep = |done: Result<()>| {
            let fine = done.is_ok();
            if outcome.is_ok() {
                outcome = done;
            }
            fine
        };
        let count = members.iter().flatten().count();
        for (session, _) in members.iter_mut().flatten() {
            session.done = session.due.take();
        }
        if count == 1 {
            for (session, _) in members.iter_mut().flatten() {
                let Session { state, options, done: Some(due), .. } = &mut **session else { continue };
                keep(state.compute(exec, engine, options, &due.plan, None));
            }
            return outcome;
        }
        let mut ears = [const { [const { None }; 2] }; MEMBERS];
        for (ears, (session, _)) in ears.iter_mut().zip(members.iter_mut().flatten()) {
            *ears = session.state.ears();
        }
        listen(exec, engine, &mut ears.as_flattened_mut()[..2 * count]);
        for member in &mut members {
            let Some((session, _)) = member else { continue };
            let Session { state, options, done: Some(due), .. } = &mut **session else { continue };
            if keep(state.prepare(engine, options, &due.plan, &mut None)) {
                state.begin_shared(engine, options, &due.plan);
            } else {
                *member = None;
            }
        }
        pass.sample(exec, engine.nets(), &mut members, |member| &mut member.0.state.generator);
        *shared += members.iter().flatten().count() as u64;
        let mut decoding: [Option<Decoding<'_>>; MEMBERS] = [const { None }; MEMBERS];
        for (decoding, (session, _)) in decoding.iter_mut().zip(members.iter_mut().flatten()) {
            let Session { state, options, .. } = &mut **session;
            state.take_latent(engine, options, &mut None);
            *decoding = Some(state.decoding());
        }
        engine.decoder.step_all(exec, decoder, &mut decoding);
        let mut posing: [Option<Posing<'_>>; MEMBERS] = [const { None }; MEMBERS];
        for (posing, (session, _)) in posing.iter_mut().zip(members.iter_mut().flatten()) {
            let Session { state, options, done: Some(due), .. } = &mut **session else { continue };
            state.decoded(exec, engine, options, &due.plan, &mut None);
            *posing = Some(Posing { state, plan: &due.plan, done: Ok(()) });
        }
        exec.pool_mut().each(&mut posing[..count], |_, posing| {
            let Some(Posing { state, plan, done }) = posing else { return };
            *done = state.pose(None, engine);
            if done.is_ok() {
                state.present(engine, plan, &mut None);
            }
        });
        for posing in posing.into_iter().flatten() {
            keep(posing.done);
        }
        outcome
    }
}

/// A session whose features are to become frames.
struct Posing<'a> {
    state: &'a mut BlockState,
    plan: &'a Plan,
    done: Result<()>,
}

/// The first session that is due, and those that can share its passes; `None` when all are done.
fn gather<'a, 's>(sessions: &'a mut [(&'s mut Session, f64)]) -> Option<[Option<Member<'a, 's>>; MEMBERS]> {
    let mut members: [Option<Member<'a, 's>>; MEMBERS] = [const { None }; MEMBERS];
    let (mut count, mut left) = (0, 0);
    for member in sessions {
        let Some(Due { plan, .. }) = member.0.due else { continue };
        let rows = member.0.shared_rows(&plan);
        let Some(first) = &members[0] else {
            (members[0], count) = (Some(member), 1);
            // A session that shares with nobody leaves no room.
            left = SHARED_ROWS.saturating_sub(rows.unwrap_or(SHARED_ROWS));
            continue;
        };
        let same = first.0.due.is_some_and(|due| due.plan.sampler == plan.sampler)
            && first.0.state.generator.alike(&member.0.state.generator, plan.sampler);
        if let Some(rows) = rows.filter(|rows| same && *rows <= left && count < MEMBERS) {
            members[count] = Some(member);
            (count, left) = (count + 1, left - rows);
        }
    }
    (count > 0).then_some(members)
}

impl Session {
    /// Rows of a shared pass that the block of `plan` takes; `None` where it cannot share one.
    fn shared_rows(&self, plan: &Plan) -> Option<usize> {
        let rows =
            self.state.generator.rows(plan.sampler, self.options.diagnostics.gaze_control.guides(self.options.gaze))?;
        (plan.hold == Hold::No).then_some(rows)
    }
}
