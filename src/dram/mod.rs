//! The featherweight generator: dyadic residual attention (Ahuja, Ma, Morency and Sheikh 2019),
//! one deterministic, causal step a frame.
//!
//! Two predictors say what the pose does next: the *monadic* one, from the agent's own voice and
//! motion, `m`; and the *dyadic* one, from what the user said and did a block before, and from the
//! monadic forecast, `d`. How much they differ decides whom the body follows, number by number:
//!
//! ```text
//! Delta = tanh |d - m|,    p' = p + s ((1 - Delta) m + Delta d)
//! ```
//!
//! with `p` the standardised pose of the frame before and `s` the usual size of a step. The two
//! predictors, `Delta` and the sum are the paper's; that forecasts are steps, and what they are
//! counted in, is ours (`training/visavis_train/dram/nets.py` says why, and is mirrored here).
//!
//! | file | what |
//! |---|---|
//! | `pose` | pose vectors to joints and back |
//! | `seen` | what is known of the user in a frame, as the predictor takes it |
//! | `state` | all that one agent remembers |
//! | `backbone` | a predictor: dilated convolutions or LSTM cells, a step of several agents at once |
//! | `network` | both predictors, and the step |
//!
//! Each file knows those above it.

mod backbone;
mod network;
mod pose;
mod seen;
mod state;
#[cfg(test)]
mod tests;

pub use network::{Agent, Dram, Work};
pub use pose::{Bones, LEAD, pose_size};
pub use seen::{Seen, USER};
pub use state::State;
