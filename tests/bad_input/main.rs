//! Hostile bundles: a typed error that names the file and what is wrong.

#[path = "../common/mod.rs"]
mod common;

mod bundle;
mod lies;
