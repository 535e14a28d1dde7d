//! Both predictors, and the step of several agents.

use super::backbone::{Backbone, Scratch};
use super::pose::{Bones, orthonormalise, per_joint, pose_size};
use super::seen::{Seen, USER};
use super::state::State;
use crate::bundle::Tensors;
use crate::config::DramConfig;
use crate::error::{Error, ErrorKind, Result};
use crate::frame::BLOCK_FRAMES;
use crate::kernels::{Exec, Kernels};
use crate::rig::Rig;

/// The last step is told to the predictor within so many of its usual sizes.
const MOST: f32 = 8.0;
/// Most frames of an idle clip.
const MAX_IDLE_FRAMES: usize = 3600;

/// Weights, statistics, and the state that every session starts from.
#[derive(Debug)]
pub struct Dram {
    monadic: Backbone,
    dyadic: Backbone,
    mean: Vec<f32>,
    std: Vec<f32>,
    step: Vec<f32>,
    /// Width of a voice's features.
    features: usize,
    bones: Bones,
    start: State,
    /// The idle clip's last pose, `[D]`.
    idle: Vec<f32>,
}

/// An agent in a step: its state, and what it knows in the four frames of its block.
#[derive(Debug)]
pub struct Agent<'a> {
    /// Its state.
    pub state: &'a mut State,
    /// Features of its own voice in these frames, `[4, features]`; none while it has no voice.
    pub voice: Option<&'a [f32]>,
    /// Features of the user's voice four frames before.
    pub user: Option<&'a [f32]>,
    /// What is known of the user four frames before.
    pub seen: &'a [Seen; BLOCK_FRAMES],
}

/// Working memory of steps; what the last one computed, for whoever looks.
#[derive(Debug)]
pub struct Work {
    scratch: Scratch,
    x: Vec<f32>,
    m: Vec<f32>,
    d: Vec<f32>,
    delta: Vec<f32>,
    rows: Vec<[f32; USER]>,
    size: usize,
}

impl Work {
    /// Of the last step, row `i` among those that took part: the user's row, both forecasts and
    /// Delta.
    pub fn stages(&self, i: usize) -> [(&'static str, &[f32]); 4] {
        let row = |v| row(v, i, self.size);
        [("user_rows", &self.rows[i]), ("m", row(&self.m)), ("d", row(&self.d)), ("delta", row(&self.delta))]
    }
}

fn row(v: &[f32], i: usize, size: usize) -> &[f32] {
    &v[i * size..(i + 1) * size]
}

impl Dram {
    /// Reads `monadic.*`, `dyadic.*`, `stats.*` and `idle.frames` for a rig and voices of
    /// `features` features; runs the idle clip on `exec`, whose limit [`Dram::widest_of`] tells.
    ///
    /// # Errors
    /// As [`Tensors::f32`]; [`ErrorKind::BundleInvalid`] for statistics that are not positive and
    /// an idle clip of the wrong length.
    pub fn load(
        t: &Tensors<'_>,
        kernels: Kernels,
        exec: &mut Exec,
        config: &DramConfig,
        rig: &Rig,
        features: usize,
    ) -> Result<Self> {
        let size = pose_size(rig.len());
        let own = [2 * size + features + 1, size];
        let other = [2 * size + USER + features + 1, size];
        let (monadic, dyadic) = match config {
            DramConfig::Tcn { monadic, dyadic } => (
                Backbone::tcn(t, kernels, "monadic", own, monadic)?,
                Backbone::tcn(t, kernels, "dyadic", other, dyadic)?,
            ),
            DramConfig::Lstm { monadic, dyadic } => (
                Backbone::lstm(t, kernels, "monadic", own, monadic)?,
                Backbone::lstm(t, kernels, "dyadic", other, dyadic)?,
            ),
        };
        let (count, frames) = t.f32_rows("idle.frames", size)?;
        if !(2..=MAX_IDLE_FRAMES).contains(&count) {
            return Err(invalid(format!("tensor idle.frames has {count} frames, not 2 to {MAX_IDLE_FRAMES}")));
        }
        let mut dram = Self {
            start: State::new(monadic.memory(), dyadic.memory(), rig.len()),
            monadic,
            dyadic,
            mean: t.f32("stats.pose_mean", &[size])?,
            std: positive("stats.pose_std", t.f32("stats.pose_std", &[size])?)?,
            step: positive("stats.step_std", t.f32("stats.step_std", &[size])?)?,
            features,
            bones: Bones::new(rig),
            idle: frames[(count - 1) * size..].to_vec(),
        };
        dram.start = dram.idled(exec, &frames);
        Ok(dram)
    }

    /// The state after the idle clip `frames`, `[n, D]`, with nobody there.
    fn idled(&self, exec: &mut Exec, frames: &[f32]) -> State {
        let (mut work, mut state) = (self.work(1), self.start.clone());
        let standardised = |state: &mut Vec<f32>, frame: &[f32]| self.standardise(frame, state);
        let seen = [Seen::default(); BLOCK_FRAMES];
        let size = self.size();
        exec.begin();
        for i in 1..=frames.len() / size {
            standardised(&mut state.p, row(frames, i - 1, size));
            standardised(&mut state.q, row(frames, i.saturating_sub(2), size));
            if i < frames.len() / size {
                self.step(exec, &mut work, &mut [&mut state], 0, |state| {
                    Some(Agent { state, voice: None, user: None, seen: &seen })
                });
            }
        }
        exec.end();
        state
    }

    /// Inputs of the widest layer that a bundle of this configuration has: what an [`Exec`] must
    /// allow for.
    pub fn widest_of(config: &DramConfig, joints: usize, features: usize) -> usize {
        let (a, b) = match config {
            DramConfig::Tcn { monadic, dyadic } => (monadic.width, dyadic.width),
            DramConfig::Lstm { monadic, dyadic } => (monadic.width, dyadic.width),
        };
        (2 * pose_size(joints) + USER + features + 1).max(2 * a.max(b))
    }

    /// Length D of a pose vector.
    pub fn size(&self) -> usize {
        self.mean.len()
    }

    /// The rig's bones.
    pub fn bones(&self) -> &Bones {
        &self.bones
    }

    /// The pose that sessions start from, `[D]`.
    pub fn idle(&self) -> &[f32] {
        &self.idle
    }

    /// Bytes of the packed matrices, all of which a step reads.
    pub fn bytes(&self) -> usize {
        self.monadic.bytes() + self.dyadic.bytes()
    }

    /// Multiply-adds of a step.
    pub fn products(&self) -> usize {
        self.monadic.products() + self.dyadic.products()
    }

    /// A state at the start.
    pub fn state(&self) -> State {
        self.start.clone()
    }

    /// Puts `state` back to the start, without allocating.
    pub fn restart(&self, state: &mut State) {
        state.copy_from(&self.start);
    }

    /// Goes on from poses `before` and `last`, `[D]` each, instead of those that were made.
    pub fn amend(&self, state: &mut State, before: &[f32], last: &[f32]) {
        self.standardise(before, &mut state.q);
        self.standardise(last, &mut state.p);
    }

    fn standardise(&self, y: &[f32], p: &mut [f32]) {
        for (((p, y), mean), std) in p.iter_mut().zip(y).zip(&self.mean).zip(&self.std) {
            *p = (y - mean) / std;
        }
    }

    /// Working memory for steps of up to `agents` agents.
    pub fn work(&self, agents: usize) -> Work {
        let (size, inputs) = (self.size(), self.monadic.inputs().max(self.dyadic.inputs()));
        let [m, d, delta] = [(); 3].map(|()| vec![0.0; agents * size]);
        Work {
            scratch: Scratch::new([&self.monadic, &self.dyadic], agents),
            x: vec![0.0; agents * inputs],
            m,
            d,
            delta,
            rows: vec![[0.0; USER]; agents],
            size,
        }
    }

    /// Makes frame `frame` (0 to 3) of the block of each of `members` that `agent` says takes part,
    /// with one pass over the weights; returns how many those were.
    ///
    /// # Panics
    /// When there are more than `work` is for, or features of another length.
    pub fn step<M>(
        &self,
        exec: &mut Exec,
        work: &mut Work,
        members: &mut [M],
        frame: usize,
        agent: impl for<'a> Fn(&'a mut M) -> Option<Agent<'a>> + Copy,
    ) -> usize {
        let (size, voice) = (self.size(), self.features + 1);
        let Work { scratch, x, m, d, delta, rows, .. } = work;
        let mut n = 0;
        let own = self.monadic.inputs();
        for (Agent { state, voice: features, .. }, x) in
            members.iter_mut().filter_map(agent).zip(x.chunks_exact_mut(own))
        {
            let (p, rest) = x.split_at_mut(size);
            let (e, sound) = rest.split_at_mut(size);
            p.copy_from_slice(&state.p);
            for (((e, p), q), s) in e.iter_mut().zip(&state.p).zip(&state.q).zip(&self.step) {
                *e = ((p - q) / s).clamp(-MOST, MOST);
            }
            self.sound(features, frame, sound);
            n += 1;
        }
        if n == 0 {
            return 0;
        }
        let (m, d, delta) = (&mut m[..n * size], &mut d[..n * size], &mut delta[..n * size]);
        self.monadic.step(exec, scratch, &x[..n * own], m, members, |member| {
            agent(member).map(|agent| (agent.state.frame, agent.state.monadic.as_mut_slice()))
        });
        let other = self.dyadic.inputs();
        for (i, (Agent { state, user, seen, .. }, x)) in
            members.iter_mut().filter_map(agent).zip(x.chunks_exact_mut(other)).enumerate()
        {
            let (zm, rest) = x.split_at_mut(size);
            let (step, rest) = rest.split_at_mut(size);
            let (place, sound) = rest.split_at_mut(rest.len() - voice);
            step.copy_from_slice(row(m, i, size));
            for (((zm, p), m), s) in zm.iter_mut().zip(&state.p).zip(&*step).zip(&self.step) {
                *zm = p + s * m;
            }
            rows[i] = seen[frame].row(&state.root);
            place.copy_from_slice(&rows[i]);
            self.sound(user, frame, sound);
        }
        self.dyadic.step(exec, scratch, &x[..n * other], d, members, |member| {
            agent(member).map(|agent| (agent.state.frame, agent.state.dyadic.as_mut_slice()))
        });
        exec.tanh_distance(d, m, delta);
        for (i, Agent { state, .. }) in members.iter_mut().filter_map(agent).enumerate() {
            self.advance(state, frame, row(m, i, size), row(d, i, size), row(delta, i, size));
        }
        n
    }

    /// A voice's features of frame `frame` of a block and that they are there, or zeros.
    fn sound(&self, features: Option<&[f32]>, frame: usize, sound: &mut [f32]) {
        match features {
            Some(features) => {
                sound[..self.features].copy_from_slice(row(features, frame, self.features));
                sound[self.features] = 1.0;
            }
            None => sound.fill(0.0),
        }
    }

    /// Takes the step of frame `frame`.
    fn advance(&self, state: &mut State, frame: usize, m: &[f32], d: &[f32], delta: &[f32]) {
        let (size, joints) = (self.size(), self.bones.count());
        let State { p, q, y, shares, root, .. } = state;
        let y = &mut y[frame * size..(frame + 1) * size];
        std::mem::swap(p, q);
        for c in 0..size {
            let step = (1.0 - delta[c]) * m[c] + delta[c] * d[c];
            y[c] = (q[c] + self.step[c] * step) * self.std[c] + self.mean[c];
        }
        orthonormalise(y);
        self.standardise(y, p);
        per_joint(delta, &mut shares[frame * joints..(frame + 1) * joints]);
        *root = root.advanced(y[0], y[1], y[2]);
        state.frame += 1;
    }
}

fn positive(name: &str, values: Vec<f32>) -> Result<Vec<f32>> {
    match values.iter().position(|v| *v <= 0.0) {
        None => Ok(values),
        Some(i) => Err(invalid(format!("tensor {name} is {} at element {i}; deviations are positive", values[i]))),
    }
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::BundleInvalid, format!("{message}; export the bundle again"))
}
