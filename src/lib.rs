#![doc = include_str!("../README.md")]
#![cfg_attr(visavis_rtsan, feature(sanitize))]

pub mod audio;
pub mod bench;
mod bounded;
pub mod bundle;
pub mod config;
pub mod engine;
pub mod error;
pub mod eval;
pub mod export;
pub mod flow;
pub mod frame;
#[allow(unsafe_code, reason = "SIMD loads, stores and inline assembly")]
pub mod kernels;
pub mod metrics;
pub mod nn;
pub mod offline;
#[allow(unsafe_code, reason = "the fork-join pool hands slices to its worker")]
pub mod par;
pub mod pose;
pub mod quant;
mod queue;
pub mod recording;
pub mod report;
pub mod session;
pub mod soak;
pub mod trace;
pub mod user;
pub mod vae;
