//! The flow-matching generator (SARAH 3.3): conditioning goes in, the latent of the next block
//! comes out.
//!
//! A latent is carried from noise to data along `z^tau = tau z + (1 - tau) eps`; the network
//! predicts the end `z` (x1 prediction) from `z^tau`, its history and the conditioning. History
//! enters by imputation at the same flow time, and because a token's noise is fixed for its life,
//! the keys and values of finished tokens at one flow time (a *slot*) never change: each slot keeps
//! its own ring cache and a pass runs only the newest finished token and the new one.
//!
//! | file | what |
//! |---|---|
//! | `condition` | what a token is told: user, two voices, gaze, each present or absent |
//! | `history` | latents, noise and conditioning of the last tokens |
//! | `noise` | the counter-based generator |
//! | `network` | weights; embeddings |
//! | `modulation` | shifts, scales and gates of flow times |
//! | `nets` | reference and student, guidance weights |
//! | `schedule` | flow times as fractions, slots by number |
//! | `projected` | embedded conditioning of the last tokens |
//! | `slots` | one cache per slot |
//! | `pass` | passes over a few rows, of one generator or several |
//! | `upkeep` | passes that keep a slot up to date with the history |
//! | `making` | the rules: midpoint, Euler, single step, guidance |
//! | `generator` | all that a session's networks remember |
//! | `sampling` | tokens of one generator or several, from noise to latents |
//!
//! Each file knows those above it. Mirrors `training/visavis_train/nets/flow.py`.

mod condition;
mod generator;
mod history;
mod making;
mod modulation;
mod nets;
mod network;
mod noise;
mod pass;
mod projected;
mod sampling;
mod schedule;
mod slots;
mod upkeep;

pub use condition::{Condition, ConditionLayout};
pub use generator::{Generator, GeneratorOptions};
pub use modulation::Modulation;
pub use nets::{Guidance, Nets};
pub use network::FlowNet;
pub use noise::{normal, uniform};
pub use pass::{SHARED_ROWS, Tools, Work};
pub use sampling::sample;
pub use schedule::{flow_times, reference_slots, student_slots};
pub use upkeep::Stretch;
