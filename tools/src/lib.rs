//! What the `visavis` command does, as a library: recordings in and out, measures, judgements,
//! quantised bundles' reports.
//!
//! | module | what |
//! |---|---|
//! | [`offline`] | a session over whole files |
//! | [`contents`] | what a bundle holds, for people |
//! | [`recording`] | finished motion with what was heard and seen |
//! | [`export`] | a recording to BVH, glTF, VRMA and the HTML viewer |
//! | [`metrics`] | measures of motion |
//! | [`eval`] | a bundle judged on recorded conversations |
//! | [`report`] | what quantised bundles lose and cost |
//! | [`soak`] | one session driven for hours |
//! | [`mod@bench`] | block times, stages, memory |
//! | [`react`] | a whole clip of sounds to motion |
//! | [`room`] | sounds in the room of the sample conversation |
//! | [`serve`] | the live page's folder by the paths of requests |
//! | [`trace`] | every stage of a session on disk |
//!
//! The runtime itself is the crate [`visavis`].

pub mod bench;
pub mod contents;
pub mod eval;
pub mod export;
pub mod metrics;
pub mod offline;
pub mod react;
pub mod recording;
pub mod report;
pub mod room;
pub mod serve;
pub mod soak;
#[cfg(test)]
mod synthetic;
pub mod trace;
