//! Live characters: the pure state machine of a session, and what runs many of them.
//!
//! A [`Character`] is pure: it knows no clock, no thread and no engine. A [`cell`] holds one behind
//! a lock, the [`Registry`] holds all cells, and [`Sessions`] has the calls. Plans go through the
//! pack's batcher ([`planner`]).

mod calls;
pub mod cell;
mod commands;
mod describe;
pub mod drive;
mod encode;
mod error;
mod events;
mod executor;
mod keep;
mod metrics;
mod options;
mod pack;
mod peek;
mod planner;
mod registry;
mod resume;
mod space;
mod step;
pub mod styles;
mod time;
mod words;

pub use calls::{SessionLimits, Sessions};
pub use commands::{CommandResult, MAX_COMMANDS};
pub use encode::{BlockWriter, Form};
pub use error::{SessionError, SessionProblem};
pub use events::{EventQueue, MAX_WAITING_EVENTS};
pub use executor::Executor;
#[cfg(feature = "testing")]
pub use keep::read_record;
pub use keep::{Keeper, Round};
pub use metrics::{Eviction, SessionMetrics};
pub use options::{MAX_ID_CHARS, TTL_RANGE_MS};
pub use pack::{LivePack, LivePacks};
pub use registry::{MAX_SESSION_BYTES, Registry};
pub use resume::Resumed;
pub use space::{Space, SpaceError, Spaces, TenantOptions};
pub use step::{StepPlan, Stepped};
pub use time::TimeSource;
pub use words::{MAX_PERFORMERS, PERFORMER_BYTES, WordsPack, WordsPacks};
