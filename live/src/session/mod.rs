//! Sessions of live characters, and the tasks that advance them.
//!
//! The character itself is a pure state machine (`troupe-character`) without clock, threads or
//! engine. A cell holds one character behind a lock, the registry holds all cells, and [`Sessions`]
//! has the calls. Plans go through the pack's batcher.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | `id`, `owner`, `limits`, `error`, `results`, `wants`, `time` | small types that the others use |
//! | `words`, `pack` | packs, with the data that their sessions share |
//! | `events`, `encode`, [`stream`] | output: events, frames, the messages of a stream |
//! | `cell`, `registry` | one session, all sessions |
//! | `planner`, `performer` | requests for plans and for words through the batcher |
//! | `options`, `commands`, `describe`, `peek`, `step`, [`styles`] | the parts of calls |
//! | `sessions`, `calls`, `resume`, `drive` | the calls, and the task behind a stream |
//! | [`recording`] | recordings of sessions, and their replay |
//! | `space`, `keep`, `backlog` | the data of each tenant, and the state that survives a restart |
//! | `away`, `share` | sessions that other servers have, and how they come here |
//! | `uploads` | uploads that servers share |

mod away;
mod backlog;
mod calls;
mod cell;
mod coming;
mod commands;
mod describe;
mod drive;
mod encode;
mod error;
mod events;
mod executor;
mod hinge_rates;
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
pub mod recording;
mod registry;
mod results;
mod resume;
mod sessions;
mod share;
mod space;
mod step;
pub mod stream;
pub mod styles;
mod time;
mod uploads;
mod wants;
mod words;

pub use backlog::{Backlog, MAX_STORE_AGE, StoreBehind};
pub use commands::MAX_COMMANDS;
pub use drive::StreamPermit;
pub use encode::{BlockWriter, Form};
pub use error::SessionError;
pub use executor::Executor;
pub use keep::Keeper;
#[cfg(feature = "testing")]
pub use keep::read_record;
pub use limits::SessionLimits;
pub use options::TTL_RANGE_MS;
pub use owner::{End, Owner};
pub use pack::{LivePack, LivePacks};
pub use registry::MAX_SESSION_BYTES;
pub use results::{Closed, CommandResult, SessionProblem};
pub use resume::Resumed;
pub use sessions::Sessions;
pub use space::{ChangeError, Space, SpaceError, Spaces, TenantOptions};
pub use step::{StepPlan, Stepped};
pub use time::TimeSource;
pub use words::{MAX_PERFORMERS, PERFORMER_BYTES};

use events::EventQueue;
use registry::Registry;
use words::WordsPacks;
