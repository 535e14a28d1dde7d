//! What the Rust workers share: the protocol of a worker, and for peers the streaming session
//! around a network.

pub mod session;
pub mod worker;

/// Errors end a worker; the driver shows them.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;
