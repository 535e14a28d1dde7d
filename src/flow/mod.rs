//! The flow-matching generator (SARAH 3.3): conditioning goes in, the latent of the next block comes out.
//!
//! A latent is carried from noise to data along `z^tau = tau z + (1 - tau) eps`; the network predicts the end `z` (x1
//! prediction) from `z^tau`, its history and the conditioning. History enters by imputation at the same flow time, and
//! because a token's noise is fixed for its life, the keys and values of finished tokens at one flow time (a *slot*)
//! never change: each slot keeps its own ring cache and a pass runs only the newest finished token and the new one.
//!
//! | file | what |
//! |---|---|
//! | `condition` | what a token is told: user, two voices, gaze, each present or absent |
//! | `history` | latents, noise and conditioning of the last tokens |
//! | `network` | weights; embeddings |
//! | `modulation` | shifts, scales and gates of flow times |
//! | `slots` | one cache a slot; passes over a few rows |
//! | `sampler` | midpoint, Euler and single-step integration with guidance |
//! | `shared` | passes that several generators share |
//! | `noise` | the counter-based generator |
//!
//! Mirrors `training/visavis_train/nets/flow.py`.

mod condition;
mod history;
mod modulation;
mod network;
mod noise;
mod sampler;
mod shared;
mod slots;

pub use condition::{Condition, ConditionLayout};
pub use history::History;
pub use modulation::Modulation;
pub use network::FlowNet;
pub use noise::{normal, uniform};
pub use sampler::{Generator, GeneratorOptions, Guidance, Nets, X1Tap, reference_times, student_times};
pub use shared::{SHARED_ROWS, SharedPass};
pub use slots::{Branches, Slots};
