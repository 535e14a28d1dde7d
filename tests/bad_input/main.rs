//! Bad input of every kind: a typed error that names the file and what is wrong, and nothing half-written.

#[path = "../common/cli.rs"]
#[cfg(feature = "cli")]
mod cli;
#[path = "../common/mod.rs"]
mod common;

mod bundle;
#[cfg(feature = "cli")]
mod command;
mod conversation;
mod lies;
mod trace;
