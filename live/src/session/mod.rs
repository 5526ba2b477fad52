//! Live characters: the pure state machine of a session, and what runs many of them.
//!
//! The character itself is pure (`troupe-character`): it knows no clock, no thread and no engine. A
//! cell holds one behind a lock, the [`Registry`] holds all cells, and [`Sessions`] has the calls.
//! Plans go through the pack's batcher.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | `id`, `owner`, `limits`, `error`, `results`, `wants`, `time` | what the others speak of |
//! | `words`, `pack` | packs as sessions know them |
//! | `events`, `encode`, [`stream`] | what goes out: events, frames, the messages of a stream |
//! | `cell`, `registry` | one session, all sessions |
//! | `planner`, `performer` | the ways of a plan and of words through the batcher |
//! | `options`, `commands`, `describe`, `peek`, `step`, [`styles`] | the parts of calls |
//! | `sessions`, `calls`, `resume`, `drive` | the calls, and the task behind a stream |
//! | `space`, `keep` | what each tenant has, and what outlives a restart |

mod calls;
mod cell;
mod commands;
mod describe;
mod drive;
mod encode;
mod error;
mod events;
mod executor;
mod id;
mod keep;
mod limits;
mod metrics;
mod options;
mod owner;
mod pack;
mod peek;
mod performer;
mod planner;
mod registry;
mod results;
mod resume;
mod sessions;
mod space;
mod step;
pub mod stream;
pub mod styles;
mod time;
mod wants;
mod words;

pub use commands::MAX_COMMANDS;
pub use drive::StreamPermit;
pub use encode::{BlockWriter, Form};
pub use error::SessionError;
pub use events::{EventQueue, MAX_WAITING_EVENTS};
pub use executor::Executor;
#[cfg(feature = "testing")]
pub use keep::read_record;
pub use keep::{Keeper, Round};
pub use limits::SessionLimits;
pub use metrics::{Eviction, SessionMetrics};
pub use options::TTL_RANGE_MS;
pub use owner::{End, Owner};
pub use pack::{LivePack, LivePacks};
pub use registry::{MAX_SESSION_BYTES, Registry};
pub use results::{CommandResult, SessionProblem};
pub use resume::Resumed;
pub use sessions::Sessions;
pub use space::{Space, SpaceError, Spaces, TenantOptions};
pub use step::{StepPlan, Stepped};
pub use time::TimeSource;
pub use words::{MAX_PERFORMERS, PERFORMER_BYTES, WordsPack, WordsPacks};
