//! Open and closed loop: when single requests are sent.

mod closed;
mod open;
mod pace;
mod target;

pub use closed::{Clients, closed};
pub use open::{open, open_on_a_thread};
pub use pace::{OwnThread, Pace, Timer};
pub use target::Target;
