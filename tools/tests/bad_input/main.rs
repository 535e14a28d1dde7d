//! Bad input of every kind: a typed error that names the file and what is wrong, and nothing
//! half-written.

#[path = "../common/cli.rs"]
mod cli;
#[path = "../../../tests/common/mod.rs"]
mod common;

mod command;
mod conversation;
mod trace;
