//! Poses of the featherweight tier: a step a frame, from what is known frame by frame.

use super::inputs::Inputs;
use super::tools::DramTools;
use crate::dram::{Agent, Dram, Seen, State};
use crate::engine::Engine;
use crate::error::Result;
use crate::frame::{BLOCK_FRAMES, BLOCK_SAMPLES, Frame, Root};
use crate::par::Pool;
use crate::pose;

/// One agent's predictors, and what its next block knows.
pub(super) struct ByStep {
    pub(super) state: State,
    /// Whether the agent's voice and the user's were heard.
    heard: [bool; 2],
    seen: [Seen; BLOCK_FRAMES],
    /// Multiply-adds of a block, millions.
    pub(super) work: f64,
    /// A pose vector, and the one before it.
    shown: [Vec<f32>; 2],
}

impl ByStep {
    pub(super) fn new(engine: &Engine, dram: &Dram) -> Self {
        let mut rows = BLOCK_SAMPLES;
        let voice = engine.config.audio.layers.iter().map(|l| {
            rows /= l.stride;
            rows * l.kernel * l.inputs * l.outputs
        });
        let work = 2 * voice.sum::<usize>() + BLOCK_FRAMES * dram.products();
        Self {
            state: dram.state(),
            heard: [false; 2],
            seen: [Seen::default(); BLOCK_FRAMES],
            work: work as f64 / 1e6,
            shown: [(); 2].map(|()| vec![0.0; dram.size()]),
        }
    }

    pub(super) fn reset(&mut self, dram: &Dram, motion: &mut pose::Decoder, frames: &mut [Frame]) {
        dram.restart(&mut self.state);
        // The first frame's joints are room enough for the idle pose.
        let joints = &mut frames[0].global;
        dram.bones().place(dram.idle(), joints);
        motion.prime_joints(joints);
        frames.iter_mut().for_each(|frame| frame.dyadic.fill(0.0));
    }

    /// Begins a block with the agent at `root`.
    pub(super) fn begin(&mut self, root: Root, heard: [bool; 2], seen: [Seen; BLOCK_FRAMES]) {
        self.state.begin(root);
        (self.heard, self.seen) = (heard, seen);
    }

    /// The agent in a step, with features of its own voice and of the user's.
    pub(super) fn agent<'a>(&'a mut self, [voice, user]: [&'a [f32]; 2]) -> Agent<'a> {
        let Self { state, heard, seen, .. } = self;
        Agent { state, voice: heard[0].then_some(voice), user: heard[1].then_some(user), seen }
    }

    /// Makes a block with nobody there that is not shown: what it takes is known then, and motion
    /// has gone on when it returns.
    pub(super) fn rehearse(&mut self, tools: &mut DramTools<'_>, inputs: &Inputs, root: Root) {
        self.begin(root, [false; 2], [Seen::default(); BLOCK_FRAMES]);
        for frame in 0..BLOCK_FRAMES {
            let DramTools { exec, work, model } = tools;
            model.step(exec, work, &mut [&mut *self], frame, |maker| Some(maker.agent(inputs.voice_features())));
        }
        self.recover(tools.model);
    }

    /// Starts the predictors anew where they hold something that is no number; whether they did.
    fn recover(&mut self, dram: &Dram) -> bool {
        let broken = !self.state.is_finite();
        if broken {
            dram.restart(&mut self.state);
        }
        broken
    }

    /// Makes frames of the block's poses.
    pub(super) fn pose(
        &mut self,
        dram: &Dram,
        motion: &mut pose::Decoder,
        pool: Option<&mut Pool>,
        frames: &mut [Frame],
    ) -> Result<()> {
        let (size, joints) = (dram.size(), frames[0].global.len());
        let place = |i: usize, joints: &mut [_]| {
            let y = &self.state.poses()[i * size..(i + 1) * size];
            dram.bones().place(y, joints);
            [y[0], y[1], y[2]]
        };
        let placed = motion.joints_block_on(pool, place, frames);
        for (frame, dyadic) in frames.iter_mut().zip(self.state.dyadic().chunks_exact(joints)) {
            for (to, from) in frame.dyadic.iter_mut().zip(dyadic) {
                *to = if from.is_finite() { from.clamp(0.0, 1.0) } else { 0.0 };
            }
        }
        self.recover(dram);
        placed?;
        if frames.iter().any(|frame| frame.held > 0.0) {
            self.go_on(dram, motion);
        }
        Ok(())
    }

    /// What follows goes on from what was shown in the last block.
    pub(super) fn go_on(&mut self, dram: &Dram, motion: &pose::Decoder) {
        for (i, y) in self.shown.iter_mut().enumerate() {
            let (joints, step) = motion.shown_joints(BLOCK_FRAMES - 2 + i);
            dram.bones().read(joints, step, y);
        }
        let [before, last] = &self.shown;
        dram.amend(&mut self.state, before, last);
    }
}
