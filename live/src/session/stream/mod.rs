//! The messages of a stream to its client and to its watchers.

mod audience;
mod outbox;
mod said;

pub use audience::{Audience, Ending, Ticket};
pub use outbox::{Outbox, Outgoing, Outlet, Tick, TickMessage, outbox};
pub use said::{Attached, Closing, Departure, Said};
