//! Fork-join on one or two threads, for work of a few microseconds.
//!
//! [`Pool::run`] calls a function for each of `n` pieces: the caller takes them from the front and the helper thread, while it is
//! awake, from the back, until they meet. The helper spins only between [`Pool::begin`] and [`Pool::end`] and is parked otherwise.
//! Between those two nothing allocates, locks or enters the kernel. Waking and parking, which do, happen inside them.
//! [`Pool::each`] hands each element of a slice to one of the threads, to change it.

mod cores;
mod denormals;
mod each;
mod pool;

pub use cores::{current_thread_id, pin_current_thread};
pub use denormals::FlushToZero;
pub use pool::{Next, Pool};
