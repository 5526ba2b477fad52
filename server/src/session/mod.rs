//! Live characters: the pure state machine of a session, and what runs many of them.
//!
//! A [`Character`] is pure: it knows no clock, no thread and no engine. A [`cell`] holds one behind a lock, the
//! [`Registry`] holds all cells, and [`Sessions`] has the calls. Plans go through the pack's batcher ([`planner`]).

pub mod budget;
mod buffer;
mod calls;
pub mod cell;
mod character;
mod commands;
mod describe;
pub mod drive;
mod encode;
mod inbox;
mod live;
pub mod load;
mod options;
mod peek;
mod planner;
mod policy;
mod registry;
mod request;
mod step;
pub(crate) mod styles;
mod time;
mod timeline;
mod types;
mod units;

pub use buffer::CROSSFADE_FRAMES;
pub use calls::{SessionLimits, Sessions};
pub use character::Character;
pub use commands::MAX_COMMANDS;
pub use encode::{BlockWriter, Form};
pub use live::finish_live;
pub use options::{MAX_ID_CHARS, TTL_RANGE_MS};
pub use registry::Registry;
pub use time::TimeSource;
pub use types::{
    Activity, Advance, Arrival, CONTEXT_FRAMES, CharacterEvent, CharacterOptions, Clock, CommandOutcome,
    EventKind, FailReason, FrameOut, HeldObject, Intent, KeyframeError, LivePlan, LiveShape, Peek, PlanCause,
    PlanFailed, PlanRecord, PlanRequest, PlanTrace, Refusal, SUB_FRAMES, Start, Stats, Strain, View,
    WaitingCommand, World,
};
