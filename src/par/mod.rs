//! Fork-join on one or two threads, for work of a few microseconds.
//!
//! [`Pool::run`] calls a function for each of `n` pieces: the caller takes them from the front and
//! the helper thread, while it is awake, from the back, until they meet. The helper spins only
//! between [`Pool::begin`] and [`Pool::end`] and is parked otherwise. Between those two nothing
//! allocates, locks or enters the kernel, but for a thread that has nothing to do: a helper without
//! a piece for long naps, and a caller that waits for long for one yields. Waking and parking,
//! which enter it too, happen inside them. [`Pool::each`] hands each element of a slice to one of
//! the threads, to change it.
//!
//! A helper that costs more than it saves, because other work wants the cores, sits out
//! (`ledger.rs`), and one that is awake keeps off its caller's core (`apart.rs`).

mod apart;
mod cores;
mod denormals;
mod each;
mod ledger;
mod pool;
mod shared;
#[cfg(test)]
mod tests;

pub use cores::{current_thread_id, pin_current_thread};
pub use denormals::FlushToZero;
pub use pool::Pool;
pub use shared::Next;
