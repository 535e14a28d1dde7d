//! The one way from what was pushed to frames, for a session and for a team: a session alone is a
//! team of one.
//!
//! ```text
//! listen -> begin (conditioning, noise) -> sample (passes shared) -> decode -> re-anchor -> pose
//!                                       -> step, step, step, step (passes shared) ------>
//! ```
//!
//! With one block both threads work in each of its layers; with several, what belongs to one of
//! them alone goes to one thread.

use super::block::{Block, Posing};
use super::inputs::{LISTENERS, Listening, listen};
use super::tools::{DramTools, Kit, SarahTools, Tools};
use crate::flow::{SHARED_ROWS, sample};
use crate::frame::BLOCK_FRAMES;

/// Blocks that go through the networks together, at most.
pub(super) const MEMBERS: usize = 64;
/// Of these, such as share the flow network's passes: two rows each is the least.
pub(super) const LATENTS: usize = SHARED_ROWS / 2;

/// Computes `blocks`, each into the frames of its session, or holds its last pose. Several of them
/// are of one engine and can share passes ([`sample`], [`steps`]). Returns how many went through the networks.
///
/// Allocates nothing, takes no lock, makes no system call (`tests/sanitize.sh realtime` has the
/// sanitizer watch this function).
#[cfg_attr(visavis_rtsan, sanitize(realtime = "nonblocking"))]
pub(super) fn compute(tools: &mut Tools<'_>, blocks: &mut [Option<Block<'_>>]) -> usize {
    debug_assert!(blocks.len() <= MEMBERS);
    let engine = tools.engine;
    hear(tools, blocks);
    for block in blocks.iter_mut().flatten() {
        if block.moves() { block.begin(engine) } else { block.hold(tools) }
    }
    match tools.kit() {
        Kit::Sarah(mut tools) => latents(&mut tools, blocks),
        Kit::Dram(mut tools) => steps(&mut tools, blocks),
    }
    let count = pose(tools, blocks);
    blocks.iter_mut().flatten().for_each(Block::end);
    count
}

/// Latents and what is decoded of them.
fn latents(tools: &mut SarahTools<'_>, blocks: &mut [Option<Block<'_>>]) {
    sample(
        &mut tools.flow(),
        blocks,
        |block| moving(block).and_then(Block::generator),
        |block| {
            moving(block).into_iter().for_each(Block::evaluated);
        },
    );
    for block in blocks.iter_mut().filter_map(moving) {
        block.take_latent(tools);
    }
    let decoder = &tools.model.decoder;
    decoder.step_all(tools.exec, tools.vae, blocks, |block| moving(block).and_then(Block::decoding));
    for block in blocks.iter_mut().filter_map(moving) {
        block.decoded(tools);
    }
}

/// The four steps of the featherweight tier, each of all blocks.
fn steps(tools: &mut DramTools<'_>, blocks: &mut [Option<Block<'_>>]) {
    for frame in 0..BLOCK_FRAMES {
        tools.model.step(tools.exec, tools.work, blocks, frame, |block| moving(block).and_then(Block::agent));
        for (i, block) in blocks.iter_mut().filter_map(moving).enumerate() {
            block.stepped(tools, i);
        }
    }
}

/// The block, if it has motion to be computed.
fn moving<'a, 'b>(block: &'a mut Option<Block<'b>>) -> Option<&'a mut Block<'b>> {
    block.as_mut().filter(|block| block.moves())
}

/// Voices are listened to, and the rooms.
fn hear(tools: &mut Tools<'_>, blocks: &mut [Option<Block<'_>>]) {
    let mut inputs: [[Listening<'_>; LISTENERS]; MEMBERS] =
        [const { [const { Listening::Nobody }; LISTENERS] }; MEMBERS];
    let mut count = 0;
    for block in blocks.iter_mut().filter_map(moving) {
        inputs[count] = block.listening();
        count += 1;
    }
    listen(tools.exec, tools.engine, inputs[..count].as_flattened_mut());
}

/// What was decoded becomes frames; returns the number of blocks.
fn pose(tools: &mut Tools<'_>, blocks: &mut [Option<Block<'_>>]) -> usize {
    let mut posing: [Option<Posing<'_>>; MEMBERS] = [const { None }; MEMBERS];
    let mut count = 0;
    for block in blocks.iter_mut().filter_map(moving) {
        posing[count] = Some(block.posing());
        count += 1;
    }
    let (engine, pool) = (tools.engine, tools.exec.pool_mut());
    match &mut posing[..count] {
        [one] => one.iter_mut().for_each(|posing| posing.run(Some(&mut *pool), engine)),
        several => pool.each(several, |_, posing| posing.iter_mut().for_each(|posing| posing.run(None, engine))),
    }
    count
}
