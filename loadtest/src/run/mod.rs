//! Runs a plan, in this process or in several.

mod once;
mod process;
mod processes;
mod progress;

pub use once::once;
pub use processes::{WORKER, work};
pub use progress::Progress;
