//! export

pub mod viewer;
