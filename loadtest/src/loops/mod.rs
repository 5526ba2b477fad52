//! The open and the closed loop, which send single requests.

mod closed;
mod open;
mod target;
mod wait;

pub use closed::{Clients, closed};
pub use open::{open, open_on_a_thread};
pub use target::Target;
pub use wait::{OwnThread, Timer, WaitUntil};
