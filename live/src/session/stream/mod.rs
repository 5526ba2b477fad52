//! What a stream says, on its way to its client and to those who watch it.

mod audience;
mod outbox;
mod said;

pub use audience::{Audience, Ending, Ticket};
pub use outbox::{Outbox, Outgoing, Outlet, Tick, TickMessage, outbox};
pub use said::{Attached, Closing, Departure, Said};
